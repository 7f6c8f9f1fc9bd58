"""Numbers that no fit of angles has, each limit from both sides and in two periods."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.model.records import MOST_TURNS, FitRecord

SHAFT = ta.Shaft("output", 1, [1], [0.0], [1e-3])
RECORD = FitRecord(samples=10, runs=2, span=(0.0, 1.0), residual=0.1, offsets=(0.0, 0.0))

#: In periods of the most turns that an angle may have.
TAKEN: tuple[dict[str, Any], ...] = (
    {"span": (-1.0, 1.0)},
    {"span": (0.25, 0.25)},  # readings at one angle
    {"span": (-1.0, -1.0)},
    {"residual": 0.0},
    {"residual": 1.0},
    {"offsets": (-1.0, 1.0)},
)
REFUSED: tuple[tuple[dict[str, Any], str], ...] = (
    ({"span": (-1.001, 1.0)}, r"fit\.span's start"),
    ({"span": (-1.0, 1.001)}, r"fit\.span's stop"),
    ({"span": (0.25, 0.2499)}, r"fit\.span must not stop before it starts, got \("),
    ({"span": (math.nan, 1.0)}, r"fit\.span's start"),
    ({"residual": -1e-9}, r"fit\.residual"),
    ({"residual": 1.001}, r"fit\.residual"),
    ({"residual": math.nan}, r"fit\.residual"),
    ({"offsets": (0.0, -1.001)}, r"fit\.offsets\[1\]"),
    ({"offsets": (1.001, 0.0)}, r"fit\.offsets\[0\]"),
)


def of(period: float, record: FitRecord) -> ta.HarmonicModel:
    return ta.HarmonicModel([SHAFT], period=period, fit=record)


def scaled(change: dict[str, Any], period: float) -> FitRecord:
    far = MOST_TURNS * period
    times = {
        key: tuple(far * one for one in value) if isinstance(value, tuple) else far * value
        for key, value in change.items()
    }
    return replace(RECORD, **times)


@pytest.mark.parametrize("period", [360.0, 4096.0])
@pytest.mark.parametrize("change", TAKEN)
def test_what_angles_of_the_period_can_have_is_taken(change: dict[str, Any], period: float):
    record = scaled(change, period)
    assert of(period, record).fit == record


@pytest.mark.parametrize("period", [360.0, 4096.0])
@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_no_angle_of_the_period_can_have_is_refused(
    change: dict[str, Any], told: str, period: float
):
    with pytest.raises(ArgumentError, match=told):
        of(period, scaled(change, period))


@pytest.mark.parametrize("what", ["samples", "runs", "ridge", "offset_spread"])
def test_counts_and_sizes_are_not_below_zero(what: str):
    assert of(360.0, replace(RECORD, **{what: 0, "residual": None})).fit is not None
    for wrong in (-1e-9, math.nan):
        with pytest.raises(ArgumentError, match=rf"fit\.{what}"):
            of(360.0, replace(RECORD, **{what: wrong}))
