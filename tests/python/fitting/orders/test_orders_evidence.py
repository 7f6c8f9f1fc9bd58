"""Noise of orders and its degrees of freedom, bounded from both sides on white noise."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.evidence import choose_forward, fit_chosen_orders
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.noise import remaining_scatter, run_scatter
from trueangle.fitting.orders.noisespectrum import NoiseSpectrum, log_chance
from trueangle.fitting.orders.significance import examine_orders
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


def test_scatter_between_units_is_the_noise():
    """2 (R - 1) degrees of freedom each: the mean of 60 sets of 12 orders is known to 2 %."""
    found = []
    for seed in range(60):
        sums = harmonic_sums(noise_units(seed), tuple(range(1, 13)))
        found.append(run_scatter(sums, [], range(12)))
    assert np.mean(found) == pytest.approx(SIGMA**2, rel=0.08)


def test_each_order_left_tells_the_noise_of_a_reading():
    """Two degrees of freedom each: the mean of 40 sets of 57 is known to 2 %."""
    orders, told = tuple(range(1, 60)), []
    for seed in range(40):
        sums = harmonic_sums(noise_units(seed, 1, 400, line=3), orders)
        left = remaining_scatter(sums, [2])
        assert np.isnan(left).tolist() == [k == 3 for k in orders]
        told.append(np.nanmean(left))
    assert np.mean(told) == pytest.approx(SIGMA**2, rel=0.08)


def test_what_an_order_tells_is_half_of_what_it_takes_off_the_squares():
    sums = harmonic_sums(noise_units(8, 2, 40), (1, 2, 3, 4, 5))
    _, _, squares = fit_chosen_orders(sums, [1, 3])
    told = remaining_scatter(sums, [1, 3])
    for k in (0, 2, 4):
        _, _, left = fit_chosen_orders(sums, [1, 3, k])
        assert told[k] == pytest.approx((squares - left) / 2.0, rel=1e-9)
    assert np.isnan(told[[1, 3]]).all()
    assert np.isnan(remaining_scatter(sums, range(5))).all()


def test_an_order_that_differs_between_units_has_its_own_noise_and_freedom():
    units = noise_units(5, line=3)
    sums = harmonic_sums(units, (1, 2, 3, 4))
    scatter = run_scatter(sums, [], range(4))
    noise = NoiseSpectrum.flat(SIGMA**2, 200.0, 2)
    test = examine_orders(sums, [], [0, 2], noise, np.array([SIGMA**2, scatter[2]]), 4)
    _, _, left = fit_chosen_orders(sums, [])
    gains = [left - fit_chosen_orders(sums, [k])[2] for k in (0, 2)]
    assert scatter[2] > 50.0 * SIGMA**2
    # Order 3 against its own scatter with 2 (R - 1) degrees of freedom, order 1 against all.
    assert test.statistic == pytest.approx([gains[0] / SIGMA**2, gains[1] / scatter[2]])
    expected = [log_chance(gains[0] / SIGMA**2, 200.0), log_chance(gains[1] / scatter[2], 4.0)]
    assert test.log_p == pytest.approx([float(x) for x in expected])
    inverse = fit_chosen_orders(sums, [2])[1]
    assert test.variance[1] == pytest.approx(scatter[2] * np.trace(inverse) / 2.0)


def test_few_readings_choose_no_order_of_noise_more_often_than_asked():
    """Nine readings, noise from their own residual: 1 % for each of two orders."""
    chosen = 0
    for seed in range(400):
        rng = np.random.default_rng(seed)
        unit = ZeroGroupReadings(rng.uniform(0.0, 1.0, 9), rng.normal(size=9), np.ones(9), "")
        sums = harmonic_sums([unit], (1, 2))
        chosen += bool(choose_forward(sums, np.full(2, math.log(0.01)), 8, None))
    # 8 of 400 are expected; 24 would be five standard deviations more.
    assert 0 <= chosen <= 24
    # And a line of six times the noise is taken.
    rng = np.random.default_rng(1)
    turns = np.arange(9) / 9.0
    unit = ZeroGroupReadings(turns, 6.0 * np.sin(2 * np.pi * turns) + 0.3 * rng.normal(size=9),
                    np.ones(9), "")  # fmt: skip
    sums = harmonic_sums([unit], (1, 2))
    assert choose_forward(sums, np.full(2, math.log(0.01)), 8, None) == [0]


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
