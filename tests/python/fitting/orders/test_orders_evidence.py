"""Noise of orders and its degrees of freedom, bounded from both sides on white noise."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings

SIGMA = 0.3


def noise_units(seed, units=3, size=60, line=None):
    """White noise; ``line``: order of a line of another phase in every unit."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(units):
        turns = rng.uniform(0.0, 2.0, size)
        error = SIGMA * rng.normal(size=size) + 5.0 * k
        if line is not None:
            error = error + 3.0 * np.sin(2.0 * np.pi * (line * turns + k / units))
        found.append(ZeroGroupReadings(turns, error, np.ones(size), str(k)))
    return found


def test_errors_of_the_papers_amplitudes_are_those_of_the_mean_of_its_runs():
    """Three runs of 36 positions and one that verifies: sigma sqrt(2/36) / sqrt(3)."""
    theta = np.arange(36) * 10.0
    found = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        error = 0.1 * np.sin(np.radians(2.0 * theta))
        runs = [
            ta.CalibrationRun(theta, theta + error + 0.01 * rng.normal(size=36), 360.0)
            for _ in range(4)
        ]
        table = ta.select_orders(runs, candidates=range(1, 10), method="paper").table
        found.append([row.standard_error**2 for row in table])
    expected = 0.01 * math.sqrt(2.0 / 36.0) / math.sqrt(3.0)
    # 540 variances of four degrees of freedom: known to 3 %.
    assert math.sqrt(np.mean(found)) == pytest.approx(expected, rel=0.06)


def paper(phases, last=0.1):
    """Runs of order 5 with these phases, and one that verifies, of another amplitude."""
    theta = np.arange(36) * 10.0
    runs = []
    for phase, size in [*((p, 0.1) for p in phases), (phases[0], last)]:
        error = size * np.sin(np.radians(5.0 * theta + phase))
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
    return ta.select_orders(runs, candidates=range(1, 10), method="paper")


def test_the_papers_run_that_verifies_is_not_fitted():
    found = paper([10.0, 10.0, 10.0], last=0.7)
    (row,) = [row for row in found.table if row.order == 5]
    assert row.amplitude == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize(("spread", "kept"), [(50.0, True), (80.0, False), (140.0, False)])
def test_an_order_of_the_paper_repeats_its_phase_within_60_degrees(spread, kept):
    found = paper([350.0, 350.0 + 0.5 * spread, 350.0 + spread])
    assert (5 in found.orders) == kept


@pytest.mark.parametrize(("size", "told"), [(1.0, True), (0.002, False)])
def test_aliases_are_told_where_zeros_that_moved_decide(size, told):
    """Grids of 36 positions 0.3 deg apart: order 28 is turned against 8 by 11 deg."""
    from trueangle.fitting.orders.lookalikes import find_lookalikes
    from trueangle.runs.aliasing import distinct_positions

    rng = np.random.default_rng(2)
    runs, units = [], []
    for shift in (0.0, 0.3):
        theta = np.arange(36) * 10.0 + shift
        error = size * np.sin(np.radians(8.0 * theta)) + 0.01 * rng.normal(size=36)
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
        units.append(ZeroGroupReadings(theta / 360.0, error - error.mean(), np.ones(36), ""))
    (alike,) = find_lookalikes(units, distinct_positions(runs), [8.0], 0.01**2, 40)
    assert (28 not in alike) == told


def test_readings_of_weight_0_leave_the_times_of_the_others() -> None:
    """Two readings a second, then one in ten: without times the noise would be another one."""
    rng = np.random.default_rng(7)
    time = np.concatenate([np.arange(200) * 0.5, 100.0 + np.arange(40) * 10.0])
    theta = np.sort(rng.uniform(0.0, 360.0, time.size))
    drift = np.cumsum(rng.normal(0.0, 0.003 * np.sqrt(np.diff(time, prepend=-0.5))))
    error = 0.1 * np.sin(np.radians(2 * theta)) + drift + rng.normal(0.0, 0.01, time.size)
    keep = rng.random(time.size) > 0.2
    whole = ta.CalibrationRun(theta, theta + error, 360.0, time=time, weights=keep.astype(float))
    part = ta.CalibrationRun(theta[keep], (theta + error)[keep], 360.0, time=time[keep])
    both = [ta.select_orders(run, argument="reference").estimate for run in (whole, part)]
    np.testing.assert_allclose(both[0].noise, both[1].noise, rtol=1e-9)
