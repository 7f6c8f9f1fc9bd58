"""What the other channel must pass by, and how a column goes on: from both sides of each bound."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import trueangle._core as _core
from trueangle.runs.checks.record import Record
from trueangle.runs.checks.still import _least, stuck_readings

SEED = 27_400
NONE = np.zeros(0, dtype=np.intp)


def told(reference: np.ndarray, indicated: np.ndarray, **more) -> list[tuple[str, int]]:
    record = Record("1", reference, indicated, **more)
    return [(fault.fault, len(fault.rows)) for fault in stuck_readings([record])]


@pytest.mark.parametrize("sigma", [0.01, 0.3])
def test_noise_passes_by_once_in_a_thousand_million(sigma: float) -> None:
    """Of one side, by the deviation of what two channels slip from reading to reading."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    place = np.cumsum(rng.uniform(0.5, 1.5, 20_000))
    own, other = (place + sigma * rng.normal(size=place.size) for _ in range(2))
    slip = 2.0 * sigma  # a difference of differences of two
    chance = stats.norm.sf(_least(own, other, NONE) / slip)
    # The deviation is known to a hundredth.
    assert -9.5 < np.log10(chance) < -8.6


def test_counts_of_both_columns_are_allowed_for() -> None:
    """One and a half of the own and one of the other; evenly spaced places are no counts."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    place = np.cumsum(rng.uniform(0.2, 1.8, 4000))
    fine, coarse = (np.round(place / count) * count for count in (0.5, 0.8))
    for angle, count in ((fine, 0.5), (coarse, 0.8), (place, 0.0)):
        assert _core.sensor_count(angle - place, angle, 360.0) == pytest.approx(count)
    even = 0.8 * np.arange(4000.0)
    near = even + 0.01 * rng.normal(size=even.size)
    noise = 6.0 * 1.4826

    def mad(own: np.ndarray, other: np.ndarray) -> float:
        slip = np.diff(own - other)
        return float(np.median(np.abs(slip - np.median(slip))))

    for own, other, counts in (
        (fine, coarse, 1.5 * 0.5 + 0.8),
        (coarse, fine, 1.5 * 0.8 + 0.5),
        (fine, place, 1.5 * 0.5),
        (place, fine, 0.5),
        (near, even, 0.0),
        (even, near, 0.0),
    ):
        wanted = noise * mad(own, other) + counts
        assert _least(own, other, NONE) == pytest.approx(wanted, rel=1e-6)


def noisy(path: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng([SEED, seed])
    return path + 0.01 * rng.normal(size=path.size), path + 0.01 * rng.normal(size=path.size)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "fault"), [(0.9, True), (1.0, True), (1.1, True), (0.7, False),
                                              (1.3, False), (0.0, False)])  # fmt: skip
def test_a_repeated_reading_makes_up_for_what_it_missed(
    share: float, fault: bool, sign: float
) -> None:
    """To 15 %: a column that goes on from where it stood has its own reason."""
    reference, indicated = noisy(np.linspace(0.0, 400.0, 400), 1)
    for start in (60, 150, 240):
        missed = reference[start + 3] - reference[start]
        indicated[start + 1 : start + 4] = indicated[start]
        # Beside its true place from then on.
        indicated[start + 4 :] += (share - 1.0) * missed
    found = told(sign * reference, sign * indicated)
    assert found == ([("stale_samples", 9)] if fault else [])


@pytest.mark.parametrize("period", [0.0, 360.0])
def test_a_turn_more_or_less_is_made_up_for_as_well(period: float) -> None:
    reference, indicated = noisy(np.linspace(0.0, 400.0, 400), 2)
    for start in (60, 150, 240):
        indicated[start + 1 : start + 3] = indicated[start]
    angles = [np.mod(x, period) if period else x for x in (reference, indicated)]
    assert told(*angles) == [("stale_samples", 6)]


@pytest.mark.parametrize("end", ["first", "last"])
@pytest.mark.parametrize(("rows", "fault"), [(40, True), (3, False)])
def test_a_column_that_stands_to_the_end_of_the_run_or_from_its_start(
    end: str, rows: int, fault: bool
) -> None:
    """While the joint moves on: its readings there are at one end of the range."""
    reference, indicated = noisy(np.linspace(0.0, 400.0, 400), 3)
    if end == "last":
        indicated[-rows:] = indicated[-rows - 1] = indicated[: -rows - 1].max() + 0.3
    else:
        indicated[:rows] = indicated[rows] = indicated[rows + 1 :].min() - 0.3
    assert told(reference, indicated) == ([("saturated_travel", rows)] if fault else [])
    # One that rests there as the joint does is none.
    still = reference.copy()
    still[slice(-rows, None) if end == "last" else slice(rows)] = still[
        -rows if end == "last" else rows
    ]
    assert told(still, indicated) == []


def test_too_few_readings_tell_nothing_and_a_column_that_never_moves_neither() -> None:
    reference, indicated = noisy(np.linspace(0.0, 40.0, 40), 4)
    assert told(reference, np.zeros(40)) == []
    assert told(reference[:9], np.minimum(indicated[:9], 2.0)) == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_more_than_half_a_turn_that_was_missed_is_made_up_for_modulo_turns(sign: float) -> None:
    """Of 70 deg a reading three are missed: 280 deg further on looks like 80 deg back."""
    reference, indicated = noisy(70.0 * np.arange(90.0), 5)
    for start in (20, 40, 60):
        indicated[start + 1 : start + 4] = indicated[start]
    angles = [np.mod(sign * x, 360.0) for x in (reference, indicated)]
    assert told(*angles) == [("stale_samples", 9)]


def test_the_place_and_the_first_row_are_told() -> None:
    """Rows that repeat, from 1 on, with times of which two are the same."""
    reference, indicated = noisy(np.linspace(0.0, 400.0, 400), 6)
    time = 0.1 * np.arange(400.0)
    time[151] = time[150]
    indicated[300:] = 310.5
    indicated[100:104] = indicated[99]
    indicated[200:204] = indicated[199]
    record = Record("warm", reference, indicated, time=time)
    limit, stale = stuck_readings([record])
    assert limit.rows == tuple(range(302, 401))
    assert "run warm stays at 310.5 deg, the end of its range, in 99 readings" in limit.says
    assert "(first: 302) while the joint moves" in limit.says
    assert stale.rows == (*range(101, 105), *range(201, 205))
    assert "run warm does not change in 8 readings (first: 101)" in stale.says
