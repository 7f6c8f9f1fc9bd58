"""Angles that do not follow the reference: each unit, the other sign, and ratios, by name."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.errors import ArgumentError, UnitWarning
from trueangle.runs.follows import check_follows

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


@pytest.mark.parametrize("period", UNITS.values())
def test_a_reversed_angle_is_told(period: float) -> None:
    with pytest.raises(ArgumentError, match=r"angle of run 7 does not .*change its sign"):
        check_follows(run(period, -1.0, label="7"))


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("column", UNITS)
def test_another_unit_is_told_by_its_name(unit: str, column: str) -> None:
    if unit == column:
        return
    period = UNITS[column]
    given = run(period, UNITS[unit] / period, 3000)
    with pytest.raises(ArgumentError, match=f"looks like {unit} in a column of {column}"):
        check_follows(given)


@pytest.mark.parametrize("ratio", [2.5, -3.0, 7.3])
def test_a_ratio_is_told_with_its_size(ratio: float) -> None:
    with pytest.raises(ArgumentError) as told:
        check_follows(run(360.0, ratio))
    assert f"moves {ratio:.6g}" in str(told.value).replace("2.50", "2.5") or "times as far" in str(
        told.value
    )
    assert "divide it by" in str(told.value)


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
