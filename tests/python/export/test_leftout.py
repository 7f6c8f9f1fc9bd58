"""How steep terms may be beside a pattern, and the signals that they are looked at over."""

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.export.exported import ranges_of, run_time_bound, term_sizes
from trueangle.export.pattern import TurnPattern
from trueangle.model.records import FitRecord

UNITS = (360.0, 2.0 * np.pi, 1.0, 4096.0)
ARCSEC = 1_296_000.0


def model(unit, argument="reference", mirrored=False):
    """Orders 1 and 4, a bump, a delay; found at -90 to 60 deg/s, and the same in a mirror."""
    way = -1.0 if mirrored else 1.0
    speeds = (-90.0, 60.0) if not mirrored else (-60.0, 90.0)
    record = FitRecord(
        900, 1, (0.0, unit), 0.0, signals=(("velocity", *(v * unit / 360.0 for v in speeds)),)
    )
    shaft = ta.Shaft("output", 1, [1, 4], [way * 1e-3 * unit, 0.0], [0.0, 5e-4 * unit])
    place = (0.3 if not mirrored else 0.7) * unit
    terms = (
        ta.terms.LocalDefect(place, 0.02 * unit, way * 1e-3 * unit),
        ta.terms.Latency(0.002),
        ta.terms.Backlash(5e-5 * unit),
    )
    return ta.HarmonicModel([shaft], period=unit, argument=argument, terms=terms, fit=record)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("own", [0.0, 0.3])
def test_a_search_around_a_table_is_steeper_by_the_slopes_of_both(own, argument, unit):
    """The bound written out; velocities in turns per second whatever the model's unit."""
    seen = []

    def steepness(ranges):
        seen.append(ranges)
        return own

    terms = SimpleNamespace(steepness=steepness, rounding=lambda size: 1e-9 + 1e-3 * size)
    rows = [{"size_arcsec": 60.0}, {"size_arcsec": 30.0}]
    steep, rounding = run_time_bound(TurnPattern(model(unit, argument)), terms, rows)
    (ranges,) = seen
    assert ranges["velocity"] == pytest.approx((-0.25, 1.0 / 6.0))
    slope = 2.0 * np.pi * (1e-3 + 4.0 * 5e-4) + 1e-3 / 0.02 * np.exp(-0.5)
    slope = slope if argument == "reference" else 0.0
    assert steep == pytest.approx((1.0 - slope) / (1.0 - slope - own))
    wanted = (1e-9 + 1e-3 * 90.0 / ARCSEC) / (1.0 - slope - own) * ARCSEC
    assert rounding == pytest.approx(wanted)
    terms.steepness, terms.kinds = lambda ranges: 1.001 - slope, ("latency",)
    with pytest.raises(ArgumentError, match="the sum must be below 1"):
        run_time_bound(TurnPattern(model(unit, argument)), terms, rows)


@pytest.mark.parametrize("unit", UNITS)
def test_what_is_left_out_is_as_large_in_every_unit_and_in_a_mirror(unit):
    """A delay by the faster of both ways, play by its half; ranges as one would write them."""
    wanted = None
    for mirrored in (False, True):
        pattern = TurnPattern(model(unit, mirrored=mirrored))
        rows = {row["term"]: row for row in term_sizes(pattern, pattern.left_out)}
        assert list(rows) == ["latency", "backlash"]
        low, high = (-60.0, 90.0) if mirrored else (-90.0, 60.0)
        assert ranges_of(pattern, pattern.left_out[0]) == {
            "velocity": (pytest.approx(low), pytest.approx(high))
        }
        assert rows["latency"]["over"].startswith(f"{low:.4g} to {high:.4g} ")
        sizes = [row["size_arcsec"] for row in rows.values()]
        # At the joint: up to 1 / (1 - slope) of it where the reading falls behind most.
        assert 0.18 * 3600.0 < sizes[0] < 0.18 * 3600.0 / 0.92
        assert 5e-5 * ARCSEC < sizes[1] < 5e-5 * ARCSEC / 0.92
        wanted = wanted or sizes
        np.testing.assert_allclose(sizes, wanted, rtol=1e-3)
