"""What repeats at the same angle, against means cell by cell."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.estimation.regression import repeated_part
from trueangle.joint.signals import Signals, join_runs


def passes(count: int, size: int = 400, low: float = 10.0, high: float = 330.0) -> Signals:
    """There and back over one range, each run two passes."""
    one = np.linspace(low, high, size)
    angle = np.concatenate([one, one[::-1]])
    return join_runs([CalibrationRun(angle, angle, 360.0) for _ in range(count)])


def slow(residual: np.ndarray, signals: Signals, by_direction: bool) -> np.ndarray:
    """The definition, one cell after the other."""
    nothing = np.zeros_like(residual)
    segments = np.unique(signals.segment)
    places = min(residual.size // (2 * segments.size), 180)
    turn = (signals.theta / (2.0 * np.pi)) % 1.0
    place = np.minimum((turn - turn.min()) / np.ptp(turn) * places, places - 1).astype(int)
    labels = [
        (p, d if by_direction else 0.0) for p, d in zip(place, signals.direction, strict=True)
    ]
    unit = signals.run if by_direction else signals.segment
    centred = residual.copy()
    for u in np.unique(unit):
        centred[unit == u] -= residual[unit == u].mean()
    cells: dict[tuple, dict[int, float]] = {}
    for label in set(labels):
        mask = np.array([other == label for other in labels])
        for s in segments:
            if (mask & (signals.segment == s)).any():
                cells.setdefault(label, {})[s] = centred[mask & (signals.segment == s)].mean()
    again = {label: list(means.values()) for label, means in cells.items() if len(means) > 1}
    freedom = sum(len(m) - 1 for m in again.values()) - np.unique(unit).size
    if freedom < 4:
        return nothing
    between = sum(len(m) * np.mean(m) ** 2 for m in again.values()) / (len(again) - 1)
    within = sum(((m - np.mean(m)) ** 2).sum() for m in map(np.array, again.values())) / freedom
    if between <= 4.0 * within:
        return nothing
    return np.array([np.mean(again[label]) if label in again else 0.0 for label in labels])


@pytest.mark.parametrize("by_direction", [False, True])
@pytest.mark.parametrize("size", [0.0, 0.3, 0.6, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_part_is_that_of_the_definition(by_direction: bool, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    signals = passes(2, 60)
    kept = rng.random(len(signals)) < 0.8
    signals = signals.take(kept)
    error = size * np.sin(5.0 * signals.theta) * np.where(signals.direction > 0, 1.0, 0.4)
    residual = error + rng.normal(size=len(signals)) + 7.0 * signals.run
    expected = slow(residual, signals, by_direction)
    np.testing.assert_allclose(repeated_part(residual, signals, by_direction), expected, atol=1e-9)
    assert expected.any() == (size >= 0.6) or size in (0.3, 0.6)


def test_a_place_has_two_sides_where_directions_count() -> None:
    signals = passes(3, 200)
    rng = np.random.default_rng(5)
    side = np.where(signals.direction > 0.0, 1.0, -1.0) * np.sin(3.0 * signals.theta)
    residual = 5.0 * side + rng.normal(size=len(signals))
    found = repeated_part(residual, signals, by_direction=True)
    assert np.std(residual - found) < 1.3
    assert not repeated_part(residual, signals).any()


def test_what_was_passed_once_or_hardly_read_does_not_repeat() -> None:
    one = np.linspace(0.0, 300.0, 500)
    once = join_runs([CalibrationRun(one, one, 360.0)])
    assert not repeated_part(np.sin(once.theta), once).any()
    few = passes(1, 7)
    assert not repeated_part(10.0 * np.sin(few.theta), few).any()
    still = join_runs([CalibrationRun(np.zeros(40), np.zeros(40), 360.0) for _ in range(2)])
    assert not repeated_part(np.ones(40 * 2), still).any()


@pytest.mark.parametrize("by_direction", [False, True])
@pytest.mark.parametrize("runs", [2, 4])
def test_it_counts_from_the_ratio_of_the_definition_on(by_direction: bool, runs: int) -> None:
    """The size of an error from which on it counts, halved up to a thousandth of itself."""
    rng = np.random.default_rng(17)
    signals = passes(runs, 24)
    noise, low, high = rng.normal(size=len(signals)), 0.0, 20.0
    error = np.sin(2.0 * signals.theta)
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        if slow(middle * error + noise, signals, by_direction).any():
            high = middle
        else:
            low = middle
    assert low > 0.1
    assert not repeated_part(low * error + noise, signals, by_direction).any()
    assert repeated_part(high * error + noise, signals, by_direction).any()
