"""Angles that do not follow the reference: each unit, the other sign, and ratios, by name."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from trueangle import CalibrationRun, check
from trueangle.errors import ArgumentError, UnitWarning
from trueangle.runs.checks.angles import UNUSABLE_ANGLES
from trueangle.runs.checks.record import records_of
from trueangle.runs.follows import _are_plain, check_follows

UNITS = {"degrees": 360.0, "radians": 2.0 * math.pi, "turns": 1.0}


def run(period: float, factor: float, size: int = 300, label: str | None = None) -> CalibrationRun:
    turns = np.linspace(0.0, 1.5, size)
    error = 1e-3 * np.sin(2.0 * np.pi * turns)
    return CalibrationRun(turns * period, (turns + error) * factor * period, period, label=label)


@pytest.mark.parametrize("period", UNITS.values())
@pytest.mark.parametrize("size", [30, 300, 5000])
def test_what_follows_is_taken(period: float, size: int) -> None:
    check_follows(run(period, 1.0, size))
    noisy = run(period, 1.0, size)
    rng = np.random.default_rng(1)
    # A deviation of 60 degrees still follows, one of 120 no longer.
    for spread, taken in ((60.0, True), (120.0, False)):
        wide = noisy.indicated + rng.normal(0.0, spread / 360.0 * period, size)
        given = CalibrationRun(noisy.reference, wide, period)
        if taken:
            check_follows(given)
        else:
            with pytest.raises(ArgumentError, match="check units, sign, gear ratio"):
                check_follows(given)
    check_follows(CalibrationRun(noisy.reference[:3], noisy.reference[:3] * 9.0, period))


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("column", UNITS)
def test_another_unit_or_sign_is_told_by_its_name(unit: str, column: str) -> None:
    period = UNITS[column]
    given, told = run(period, UNITS[unit] / period, 3000), f"like {unit} in a column of {column}"
    if unit == column:
        given, told = run(period, -1.0, label="7"), "angle of run 7 does not .*change its sign"
    with pytest.raises(ArgumentError, match=told):
        check_follows(given)


@pytest.mark.parametrize(("top", "warned"), [(62.0, False), (350.0, True)])
def test_degrees_that_were_given_as_radians_warn(top: float, warned: bool) -> None:
    degrees = np.linspace(0.0, top, 200)
    error = 0.5 * np.sin(np.radians(degrees)) + 0.1 * np.cos(np.radians(2.0 * degrees))
    given = CalibrationRun(degrees, degrees + error)
    if warned:
        with pytest.warns(UnitWarning, match="its error repeats with 360"):
            check_follows(given)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_follows(given)
    # An error that repeats with 2 pi is one of radians, however many.
    radians = np.linspace(0.0, 350.0, 200)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_follows(CalibrationRun(radians, radians + 0.5 * np.sin(radians)))
        check_follows(CalibrationRun(degrees[:14] * 14, (degrees + error)[:14] * 14))


def message(reference: np.ndarray, indicated: np.ndarray, period: float = 360.0) -> str:
    with pytest.raises(ArgumentError) as told:
        check_follows(CalibrationRun(reference, indicated, period))
    assert not check(CalibrationRun(reference, indicated, period)).usable
    return str(told.value)


@pytest.mark.parametrize("column", UNITS)
@pytest.mark.parametrize("other", UNITS)
def test_of_two_units_that_fit_few_readings_that_of_the_runs_own_column_is_told(
    column: str, other: str
) -> None:
    """Where both factors put a reading at the same angle, they differ by whole turns."""
    if other == column:
        return
    print("seed 911")
    steps = np.random.default_rng(911).integers(-40_000, 40_000, 12)
    period = UNITS[column]
    for unit in set(UNITS) - {column}:
        mine = period / UNITS[unit]
        for wrong in set(UNITS) - {other}:
            apart = mine - UNITS[other] / UNITS[wrong]
            indicated = steps * period / apart
            told = message(np.mod(mine * indicated, period), indicated, period)
            assert f"in a column of {column}" in told


def test_a_ratio_is_that_of_two_units_to_a_hundredth() -> None:
    reference = np.linspace(0.0, 700.0, 3000)
    for near, unit in ((0.991, True), (1.009, True), (0.988, False), (1.012, False)):
        told = message(reference, reference * near / 360.0 * 2.0 * math.pi)
        assert ("looks like radians in a column of degrees" in told) == unit
        assert ("times as far" in told) == (not unit)


@pytest.mark.parametrize(("noise", "told"), [(15.0, True), (22.0, False)])
def test_a_remedy_must_make_the_readings_agree(noise: float, told: bool) -> None:
    """Normal noise of s radians leaves a resultant of exp(-s^2 / 2): 0.95 at 18.4 deg."""
    print("seed 912")
    rng = np.random.default_rng(912)
    reference = rng.uniform(0.0, 360.0, 900)
    found = message(reference, np.mod(noise * rng.normal(size=900) - reference, 360.0))
    assert ("change its sign" in found) == told
    assert ("check units, sign, gear ratio" in found) == (not told)


def test_four_readings_are_the_fewest_that_are_looked_at() -> None:
    reference = np.array([0.0, 100.0, 200.0, 300.0])
    assert "change its sign" in message(reference, -reference)
    check_follows(CalibrationRun(reference[:3], -reference[:3], 360.0))


@pytest.mark.parametrize(("size", "told"), [(60.0, True), (130.0, False)])
def test_a_ratio_is_only_told_where_all_readings_keep_to_it(size: float, told: bool) -> None:
    """About the ratio a wave of amplitude a leaves a resultant of J0(a): 0.93 and 0.71 here."""
    reference = np.linspace(0.0, 1500.0, 4000)
    indicated = -3.0 * reference + size * np.sin(reference / 20.0)
    assert ("times as far" in message(reference, indicated)) == told


@pytest.mark.parametrize(("step", "told"), [(50.0, True), (85.0, False)])
def test_steps_that_may_be_a_turn_more_or_less_tell_no_ratio(step: float, told: bool) -> None:
    """2.3 times 50 deg is a step of 115 deg; 195 look like 165 deg back."""
    found = message(*(np.mod(step * k * np.arange(40.0), 360.0) for k in (1.0, 2.3)))
    assert ("it moves 2.3 times as far" in found and "divide it by 2.3" in found) == told
    assert ("check units, sign, gear ratio" in found) == (not told)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ratio_near_one_is_named_where_dividing_by_it_makes_the_angles_agree(sign: float) -> None:
    reference = np.linspace(0.0, 20_000.0, 3000)
    scatter = np.random.default_rng(77).uniform(-180.0, 180.0, reference.size)
    for away, teeth in ((0.16, ""), (0.02, "51/50" if sign > 0 else "49/50")):
        found = message(reference, (1.0 + sign * away) * reference)
        assert f"it moves {1.0 + sign * away:.6g} times as far" in found
        assert teeth in found
        found = message(reference, (1.0 + sign * away) * reference + scatter)
        assert "check units, sign, gear ratio" in found


@pytest.mark.parametrize(
    ("top", "size", "noise", "warned"),
    [
        (64.0, 200, 0.0, True),
        (350.0, 15, 0.0, True),
        (350.0, 14, 0.0, False),
        (350.0, 800, 0.15, True),
        (350.0, 800, 0.3, False),
    ],
)
def test_degrees_must_leave_a_quarter_of_what_radians_leave(
    top: float, size: int, noise: float, warned: bool
) -> None:
    """From ten turns and 15 readings on; noise of 0.3 about a wave of 0.35 rms is half of it."""
    print("seed 913")
    degrees = np.linspace(0.0, top, size)
    error = 0.5 * np.sin(np.radians(degrees)) + noise * np.random.default_rng(913).normal(size=size)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        check_follows(CalibrationRun(degrees, degrees + error))
    assert [warning.category for warning in told] == [UnitWarning] * warned


def drawn_pair(rng: np.random.Generator) -> CalibrationRun:
    """A run of any travel, order of places, error, unit and one fault in two of three."""
    period = UNITS[rng.choice([*UNITS])]
    size = int(rng.integers(4, 200))
    turns = np.sort(rng.uniform(0.0, rng.choice([0.02, 0.3, 1.0, 3.0, 12.0]), size))
    if rng.random() < 0.5:  # at rest for a while, or there and back
        half = turns[: size // 2]
        half[:] = turns[size // 2] if rng.random() < 0.5 else half[::-1].copy()
    if rng.random() < 0.3:
        rng.shuffle(turns)
    error = 10.0 ** rng.uniform(-5, -0.7) * np.sin(2.0 * np.pi * turns * rng.integers(1, 5))
    error += rng.normal(0.0, 10.0 ** rng.uniform(-6, -2), size)
    reference = turns + rng.integers(-2, 3)
    factor = rng.choice([1.0, 1.0, 1.0 + 10.0 ** rng.uniform(-3, 0), -1.0, 0.0175, 57.3])
    indicated = factor * turns + error
    fault = rng.integers(6)
    if fault == 0:  # a part in radians
        reference[size // 4 : size // 2] /= 57.3
    elif fault == 1:  # a reference that wraps at less than a turn
        reference = np.mod(reference, rng.uniform(0.2, 0.95))
    elif fault == 2:
        indicated[rng.integers(size)] += rng.uniform(-0.5, 0.5)
    return CalibrationRun(reference * period, indicated * period, period)


def test_what_bounds_call_plain_no_test_refuses() -> None:
    """The quick look of a fit never passes over a fault, and does take most sound runs."""
    seed = 90_417
    print("seed", seed)
    rng = np.random.default_rng(seed)
    taken = plain = 0
    for _ in range(400):
        runs = [drawn_pair(rng) for _ in range(int(rng.choice([1, 1, 2])))]
        runs = [given for given in runs if given.period == runs[0].period]
        are_plain = _are_plain(runs, [1] * len(runs))
        records = records_of(runs)
        faults = [fault for test in UNUSABLE_ANGLES for fault in test(records)]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                for given in runs:
                    check_follows(given)
            except (ArgumentError, UnitWarning) as refusal:
                faults.append(refusal)
        assert not (are_plain and faults), faults
        taken += not faults
        plain += are_plain
    # Of steps beyond 20 deg rows in another unit are looked for.
    assert 0.08 * taken < plain < taken
    for size in (5, 36, 37, 4095, 4096, 8191):
        assert _are_plain([run(360.0, 1.0, size)], [1 + (size - 1) // 4096])
