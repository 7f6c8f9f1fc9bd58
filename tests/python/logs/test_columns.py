"""Finding the angle among the columns of a log."""

import pytest

from trueangle.errors import FileError
from trueangle.logs.columns import find_angle_column, find_joint_signal

FOUND = [
    # joint, columns -> column, unit, corrected
    (None, ["t", "indicated_deg"], "indicated_deg", "deg", "corrected_deg"),
    (None, ["a/indicated_rad", "a/t"], "a/indicated_rad", "rad", "a/corrected_rad"),
    ("j3", ["j2_indicated_deg", "j3_indicated_deg"], "j3_indicated_deg", "deg", "j3_corrected_deg"),
    ("j3", ["indicated_turn_j3", "j3_deg"], "indicated_turn_j3", "turn", "corrected_turn_j3"),
    ("j3", ["j3/indicated_deg", "j4/indicated_deg"], "j3/indicated_deg", "deg", "j3/corrected_deg"),
    ("j3", ["j3_rad", "j3"], "j3_rad", "rad", "j3_corrected_rad"),
    ("j3", ["j2", "j3"], "j3", "deg", "j3_corrected_deg"),
]


@pytest.mark.parametrize(("joint", "columns", "name", "unit", "corrected"), FOUND)
def test_found_by_name(joint, columns, name, unit, corrected):
    angle = find_angle_column("log", 360.0, columns, joint=joint)
    assert (angle.name, angle.unit, angle.corrected) == (name, unit, corrected)


REFUSED = [
    ({}, ["a", "b"], "no indicated_deg.*`column=`.*a, b"),
    ({}, ["indicated_deg", "indicated_rad"], "several.*`column=`"),
    ({"joint": "j1"}, ["indicated_deg"], "joint j1.*`column=.*j1.*NAME"),
    ({"joint": "j1"}, ["j1_indicated_deg", "indicated_deg_j1"], "several columns of joint j1"),
    ({"column": "x"}, ["y"], "'x': no such column"),
    ({"column": "x", "unit": "count"}, ["x"], "`counts_per_turn=`"),
    ({}, ["indicated_deg", "corrected_deg"], "corrected before"),
    *(
        ({"column": name, "unit": "turn"}, [name], "holds corrected angles: name the indicated")
        for name in ("corrected_deg", "corrected_rad_j3", "j3_corrected_count", "a/corrected_turn")
    ),
]


@pytest.mark.parametrize(("asked", "columns", "message"), REFUSED)
def test_refused_with_what_to_do(asked, columns, message):
    with pytest.raises(FileError, match=message):
        find_angle_column("log", 360.0, columns, **asked)


def test_signals_of_the_joint_come_before_common_ones():
    columns = ["temperature_C", "j1_temperature_C", "velocity_rad_s"]

    def found(signal, joint):
        return find_joint_signal("log", columns, signal, joint, None)

    assert found("temperature", "j1").name == "j1_temperature_C"
    assert found("temperature", "j2").name == "temperature_C"
    assert found("velocity", "j2").name == "velocity_rad_s"
    assert found("torque", None) is None
    with pytest.raises(FileError, match="'T': no such column"):
        find_joint_signal("log", columns, "temperature", None, ("T", None))
