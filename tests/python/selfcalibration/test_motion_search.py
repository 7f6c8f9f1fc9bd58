"""Which grid, stiffness and memory of the motion a search ends at, against all that there are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.selfcalibration.motion import MotionFit, MotionSearch
from trueangle.selfcalibration.splines import Knots, ordered_motion_sums

SEED = 61_310
INTERVALS, SPACING, PER_KNOT = 512, 0.25, 4
LENGTH = INTERVALS * SPACING


def search(read: np.ndarray, knots: Knots, trends: tuple[int, ...]) -> MotionSearch:
    """Of readings at even times over one stretch, without columns beside the motion."""
    time = np.linspace(0.0, knots.spacing * knots.intervals[0], read.size)
    index, place = knots.place(0, time)

    def none(part: slice, out: np.ndarray) -> None:
        pass

    sums = ordered_motion_sums(knots, index, place, read, np.ones(read.size), none, 0, None)
    return MotionSearch(sums, np.zeros(knots.size), (), trends)


def moved(rng: np.random.Generator, memory: float, noise: float) -> MotionSearch:
    """Readings of a motion whose acceleration forgets itself within so many seconds."""
    n = INTERVALS * PER_KNOT
    step = LENGTH / n
    acceleration, kept = np.zeros(n), math.exp(-step / memory)
    for i, push in enumerate(rng.normal(0.0, math.sqrt(1.0 - kept**2), n - 1)):
        acceleration[i + 1] = kept * acceleration[i] + push
    motion = np.cumsum(np.cumsum(acceleration)) * step**2
    read = motion + rng.normal(0.0, noise, n)
    return search(read, Knots((0.0,), (INTERVALS,), SPACING), (0,))


def best_of_all(looked: MotionSearch, memories: tuple[float, ...]) -> MotionFit:
    """Every grid, many stiffnesses, memories no shorter than the distance of knots."""
    fits = []
    level = 0
    while (grid := looked.grid(level)) is not None:
        knots = grid.sums.knots
        per_knot = looked.sums.weighty / sum(knots.intervals)
        fits += [
            looked.fit(level, per_knot * 10.0**power, memory)
            for memory in memories
            if memory >= knots.spacing
            for power in np.arange(-5.0, 7.1, 0.5)
        ]
        level += 1
    return max(fits, key=lambda fit: fit.evidence)


@pytest.mark.parametrize(("share", "noise"), [(1e3, 1e-3), (0.1, 1e-3), (0.05, 1e-2)])
def test_the_memory_of_the_motion_is_found_among_those_that_are_tried(
    share: float, noise: float
) -> None:
    """A whole log, a tenth or a hundredth of it: none has more evidence, on any grid."""
    print("seed", SEED)
    looked = moved(np.random.default_rng(SEED), share * LENGTH, noise)
    found = looked.best()
    memories = (LENGTH, 0.1 * LENGTH, 0.01 * LENGTH)
    every = best_of_all(looked, memories)
    assert found.memory in memories
    assert found.evidence > every.evidence - 2.0
    assert found.memory == pytest.approx(LENGTH if share > 1.0 else 0.1 * LENGTH)
    assert found.readings == INTERVALS * PER_KNOT
    # Beside its own grid and its neighbours nothing better is to be looked for.
    assert looked.best(near=found).evidence > found.evidence - 1.0


@pytest.mark.parametrize("trends", [0, 1, 2, 4, 5, 10])
def test_the_coarsest_grid_has_two_intervals_to_a_trend_and_four_more(trends: int) -> None:
    """Grids of 48, 24, 12 and 6 intervals: the last of them that is fine enough."""
    looked = search(np.linspace(0.0, 1.0, 200), Knots((0.0,), (48,), 0.5), (trends,))
    found = looked.best(shortest=math.inf)
    fit = [n for n in (48, 24, 12, 6) if n >= 2 * trends + 4]
    assert found.knots.intervals == (fit[-1],)
    assert found.stiffness == pytest.approx(200.0 / fit[-1] * 1e7)
