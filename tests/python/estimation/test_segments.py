"""Stretches of flags and the level about a reading, against loops."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.estimation.segments import (
    flagged_segments,
    less_local_level,
    short_segments,
    within_segments,
)

BOUNDS = [(0, 13), (13, 14), (14, 20), (20, 25), (25, 60)]


def slow(flags: np.ndarray) -> list[tuple[int, int]]:
    found = []
    for start, stop in BOUNDS:
        k = start
        while k < stop:
            end = k
            while end < stop and flags[end]:
                end += 1
            if end > k:
                found.append((k, end))
            k = end + 1
    return found


@pytest.mark.parametrize("seed", range(30))
def test_stretches_are_those_of_a_loop(seed: int) -> None:
    flags = np.random.default_rng(seed).random(60) < [0.1, 0.5, 0.9, 1.1][seed % 4]
    starts, stops = flagged_segments(flags, BOUNDS)
    assert list(zip(starts.tolist(), stops.tolist(), strict=True)) == slow(flags)
    np.testing.assert_array_equal(within_segments(starts, stops, 60), flags)
    expected = np.zeros(60, bool)
    for a, b in slow(flags):
        expected[a:b] = b - a <= 4
    np.testing.assert_array_equal(short_segments(flags, BOUNDS), expected)


def test_stretches_that_touch_or_overlap() -> None:
    found = within_segments(np.array([1, 3, 4]), np.array([3, 6, 5]), 7)
    assert found.tolist() == [False, True, True, True, True, True, False]
    assert not within_segments(np.zeros(0, int), np.zeros(0, int), 3).any()


def test_the_level_is_the_median_of_those_about() -> None:
    values = np.random.default_rng(1).normal(size=60) + np.arange(60)
    found = less_local_level(values, BOUNDS)
    for start, stop in BOUNDS:
        part = values[start:stop]
        n = part.size
        for k in range(n):
            about = range(n) if n <= 5 else [abs(j) if j < n else 2 * (n - 1) - j
                                             for j in range(k - 5, k + 6)]  # fmt: skip
            assert found[start + k] == pytest.approx(part[k] - np.median(part[list(about)]))
