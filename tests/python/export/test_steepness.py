"""Bounds of what terms add to a slope, against slopes of the errors that the model computes."""

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.errors import ArgumentError
from trueangle.export.exported import ranges_of, run_time_bound, term_sizes
from trueangle.export.pattern import TurnPattern
from trueangle.export.runtimeterms import RunTimeTerms
from trueangle.model.records import FitRecord

UNITS = (360.0, 2.0 * np.pi, 1.0)
RANGES = {
    "velocity": (-1.5, 0.5), "temperature": (5.0, 60.0), "torque": (-20.0, 12.0),
    "current": (-2.0, 3.0),
}  # fmt: skip


def terms_of(unit):
    """Each with a share of its bound that some reading within the ranges is as steep as."""
    line = {"orders": (3.0,), "cosine": (2e-4 * unit,), "sine": (-1e-4 * unit,)}
    per = {"orders": (3.0,), "cosine": (-2e-4,), "sine": (1e-4,)}
    stiff = (-1e-5 * unit, -1e-8 * unit, -1e-5 * unit, 5.0, 0.7 * unit)
    return {
        "play that varies": (T.Backlash(1e-3 * unit, **line), 0.999),
        "friction": (T.PreslidingHysteresis(-1e-3 * unit, 0.02 * unit), 0.99),
        "a line by the velocity": (T.VaryingLine(**per), 0.999),
        "a line by the speed": (T.VaryingLine(**per, follows="speed"), 0.999),
        "a line by the load": (T.LoadDependentGearError(**line), 0.999),
        "warmth of a pattern": (T.ThermalDrift(1e-5 * unit, -1e-3), 0.999),
        "warmth of a line": (T.ThermalDrift(1e-5 * unit, **line, reference_C=20.0), 0.999),
        "weight on a soft spring": (T.StiffeningCompliance(-1e-4 * unit, gravity=0.2 * unit), 0.99),
        "weight on a spring": (T.StiffeningCompliance(*stiff), 0.5),
        "weight beyond a knee": (
            T.StiffeningCompliance(0.0, 0.0, -1e-4 * unit, 0.5, 0.7 * unit), 0.99),
        "a bump": (T.LocalDefect(0.3 * unit, 0.01 * unit, -1e-3 * unit), 0.999),
        "a bump of a fast shaft": (T.LocalDefect(0.3 * unit, 0.07 * unit, 1e-3 * unit, 7.0), 0.999),
        "a ratio": (T.ScaleError(-1e-4, -unit, unit), 0.999),
        "a low-pass": (T.FilterLag(0.2), 0.48),
        "a low-pass that rings": (T.FilterLag(15.0, 0.1), 0.8),
        "a low-pass of critical damping": (T.FilterLag(0.5, 1.0), 0.45),
        "a spring alone": (T.StiffeningCompliance(1e-4 * unit), 1.0),
    }  # fmt: skip


def steepest(model, plain):
    """Largest slope of what the terms add, to and fro, over a grid of every signal."""
    unit = model.period
    angle = np.arange(-8000, 8001) * (unit / 8000.0)
    x = np.concatenate([angle, angle[-2::-1]])
    steps, around = np.diff(x), plain.error(x)
    goes_on = steps[1:] * steps[:-1] > 0.0  # play jumps where the travel turns round
    found = 0.0
    for share in np.linspace(0.0, 1.0, 41):
        told = {name: low + share * (high - low) for name, (low, high) in RANGES.items()}
        told["velocity"] *= unit
        given = {name: np.full(x.size, told[name]) for name in model.signals if name in told}
        slope = np.diff(model.error(x, **given) - around) / steps
        found = max(found, float(np.abs(slope[1:][goes_on]).max()))
    return found


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("name", list(terms_of(1.0)))
def test_terms_are_as_steep_as_stated_somewhere_and_nowhere_steeper(name, unit):
    term, share = terms_of(unit)[name]
    shaft = ta.Shaft("motor", 3, (1, 2), (1e-3 * unit, 0.0), (-5e-4 * unit, 0.0))
    plain = ta.HarmonicModel((shaft,), period=unit)
    model = plain.replace(terms=(term,))
    bound = RunTimeTerms.of(model, (term,), "auto").steepness(RANGES)
    found = steepest(model, plain)
    print(found, bound)
    assert found <= bound * (1.0 + 1e-6) + 1e-9
    assert found >= share * bound - 1e-9


@pytest.mark.parametrize("damping", [None, 0.05, 0.3, 0.5, 0.7, 0.71, 1.0, 3.0])
def test_a_low_pass_counts_with_the_peak_of_its_response(damping):
    """The harmonics themselves, and what is left of them where the filter rings most."""
    shaft = ta.Shaft("motor", 3, (1, 2), (1e-3, 0.0), (0.0, -5e-4))
    term = T.FilterLag(10.0, damping)
    model = ta.HarmonicModel((shaft,), period=1.0, terms=(term,))
    ratio = np.linspace(0.0, 3.0, 300_001)
    response = 1.0 / (1.0 + 1j * ratio)
    if damping is not None:
        response = 1.0 / (1.0 - ratio**2 + 2j * damping * ratio)
    slope = 2.0 * np.pi * (3.0 * 1e-3 + 6.0 * 5e-4)
    wanted = (1.0 + np.abs(response).max()) * slope
    found = RunTimeTerms.of(model, (term,), "auto").steepness(RANGES)
    assert found == pytest.approx(wanted, rel=1e-6)


def test_terms_add_up_and_signals_that_are_not_known_move_nothing():
    model = ta.HarmonicModel(
        (ta.Shaft("output", 1, (2,), (1e-3,), (0.0,)),),
        period=1.0,
        terms=tuple(term for term, _ in terms_of(1.0).values()),
    )
    each = [RunTimeTerms.of(model, (term,), "auto").steepness(RANGES) for term in model.terms]
    whole = RunTimeTerms.of(model, model.terms, "auto")
    assert whole.steepness(RANGES) == pytest.approx(sum(each), rel=1e-12)
    heat = {"temperature": (20.0, 20.0)}
    still = dict.fromkeys(RANGES, (0.0, 0.0)) | heat
    assert whole.steepness(heat) == whole.steepness(still) < whole.steepness(RANGES)
    mirrored = {name: (-high, -low) for name, (low, high) in RANGES.items()}
    assert whole.steepness(mirrored | heat) == pytest.approx(whole.steepness(RANGES | heat))


LEFTOUT_UNITS = (360.0, 2.0 * np.pi, 1.0, 4096.0)
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


@pytest.mark.parametrize("unit", LEFTOUT_UNITS)
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


@pytest.mark.parametrize("unit", LEFTOUT_UNITS)
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
