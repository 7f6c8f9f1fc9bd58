"""What stands out of its neighbours: reading by reading, from both sides of every border."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.outliers import (
    APART,
    BESIDE,
    _apart,
    _beside_neighbours,
    _glitches,
    _interpolated,
)
from trueangle.estimation.regression import Regression
from trueangle.estimation.segments import MOST_IN_ROW, less_local_level
from trueangle.joint.signals import join_runs
from trueangle.simulation import Simulation

Array = np.ndarray
SEED = 80_431


def rng() -> np.random.Generator:
    print(f"seed {SEED}")
    return np.random.default_rng(SEED)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8])
def test_each_wild_reading_is_held_against_neighbours_without_the_others(rho: float) -> None:
    """Slow: for one after the other, all others put to the level about them beforehand."""
    size, noise = 120, rng().normal(size=360)
    for k in range(1, noise.size):
        noise[k] = rho * noise[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
    # At both ends of runs, alone, and two in a row.
    wild = [0, 50, 51, 119, 120, 200, 359]
    noise[wild] += np.array([40.0, -35.0, 50.0, -45.0, 30.0, 60.0, 33.0])
    theta = np.linspace(0.0, 40.0, size)
    signals = join_runs([ta.CalibrationRun(theta, theta, 360.0)] * 3)
    start = Regression.of(signals, noise, Simulation(sigma_arcsec=1.0).surroundings, rho=rho)
    left, bounds = start.left_within_runs * start.root_weights, start.bounds
    found, spread = _beside_neighbours(start)
    away = less_local_level(left, bounds)
    level = np.array(left)
    level[wild] -= away[wild]
    for k in wild:
        known = level.copy()
        known[k] = left[k]
        beside = _interpolated(known, start.whiten.rho, bounds)[k]
        wanted = beside if abs(beside) < abs(away[k]) else away[k]
        assert found[k] * spread == pytest.approx(wanted, rel=1e-9), f"reading {k}"
    rest = np.setdiff1d(np.arange(noise.size), wild)
    others = _interpolated(level, start.whiten.rho, bounds)[rest]
    np.testing.assert_allclose(found[rest] * spread, others, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "length"),
    [(0, 1), (0, 2), (1, 1), (20, 1), (20, MOST_IN_ROW), (20, MOST_IN_ROW + 1), (38, 2), (39, 1)],
)
@pytest.mark.parametrize("beside", [0.9 * BESIDE, 1.1 * BESIDE])
def test_a_glitch_is_short_and_its_neighbours_are_far_smaller(
    beside: float, first: int, length: int
) -> None:
    """Of two runs, the second all zero: an end of a run has no neighbour in the next one."""
    values = np.zeros(80)
    rows = np.arange(first, first + length)
    for way in (1, -1):  # the large neighbour behind it, or before
        values[:] = 0.0
        values[rows] = 10.0
        neighbour = rows[0] - 1 if way < 0 else rows[-1] + 1
        if 0 <= neighbour < 40:
            values[neighbour] = 10.0 * beside
        elif neighbour == 40:
            values[40] = 9.0  # of another run
        found = _glitches(values, rows, [(0, 40), (40, 80)])
        is_glitch = length <= MOST_IN_ROW and (beside < BESIDE or not 0 <= neighbour < 40)
        assert found.tolist() == (rows.tolist() if is_glitch else [])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_few_readings_stand_apart_from_all_others(way: float) -> None:
    e = np.append(np.linspace(-1.0, 1.0, 399), 0.3)
    for share, apart in ((0.99, []), (1.01, [7])):
        e[7] = way * share * APART
        assert _apart(e).tolist() == apart
    # Both of two that are alike; four are a hundredth, five the last that can be.
    for many, told in ((2, True), (4, True), (5, True), (6, False)):
        e = np.append(np.linspace(-1.0, 1.0, 399), 0.3)
        rows = np.arange(9, 9 + many)
        e[rows] = way * 30.0
        assert _apart(e).tolist() == (rows.tolist() if told else [])
