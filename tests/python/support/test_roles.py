"""The unit that a column's name ends with, for each role and its way of writing it."""

import pytest

from trueangle.support.roles import unit_in_name


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("pos_deg", "indicated", "deg"),
        ("pos_rad", "reference", "rad"),
        ("pos (deg)", "reference", "deg"),
        ("bus/pos_arcsec", "reference", "arcsec"),
        # Of a speed the second is a part of its own.
        ("w_deg_s", "velocity", "deg/s"),
        ("axis/w_rad_s", "velocity", "rad/s"),
        ("w_deg", "velocity", None),
        ("t_s", "time", "s"),
        ("t_ms", "time", "ms"),
        ("t_s", "reference", None),
        ("w", "velocity", None),
        ("w_s", "velocity", None),
        ("pos_fast", "indicated", None),
    ],
)
def test_a_unit_is_read_from_a_name(name, role, unit):
    assert unit_in_name(name, role) == unit
