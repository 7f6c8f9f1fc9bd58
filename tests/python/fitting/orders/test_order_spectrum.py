"""Spectra at many orders: against the sum that defines them, and its known cases."""

import random

import numpy as np
import pytest

from trueangle import _core
from trueangle.effects.orderspectrum import DENSE, OrderSpectrum

#: Of the sum of magnitudes: the kernel's aliases and the rounding of a transform.
GRIDDED = 1e-12
#: What angles of some hundred turns lose by their own rounding, an order of some hundred.
ROUNDED = 1e-10


def drawn(rng, n, runs, turns):
    """Angles of some runs that overlap, in order and not, and where each begins."""
    starts = [0, *sorted(rng.choice(np.arange(1, n), runs - 1, replace=False).tolist())]
    theta = rng.uniform(-turns, turns, n) * 2.0 * np.pi
    theta[: n // 2] = np.sort(theta[: n // 2])
    return theta, starts


def by_definition(theta, starts, orders, values):
    waves = np.exp(-1j * np.outer(orders, theta)) * values
    return np.add.reduceat(waves, starts, axis=1)


@pytest.mark.parametrize("count", [300, 1001, 4096])
@pytest.mark.parametrize("runs", [1, 5])
def test_it_is_the_sum_that_defines_it(count, runs):
    seed = random.SystemRandom().randrange(2**32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    n = DENSE * runs + int(rng.integers(0, 900))
    theta, starts = drawn(rng, n, runs, float(rng.uniform(0.3, 40.0)))
    values = rng.normal(size=n) + 3.0
    first, step = float(rng.uniform(0.3, 2.0)), float(rng.uniform(1e-3, 0.2))
    spectrum = OrderSpectrum(theta, starts, first, step, count)
    assert spectrum._grid is not None
    found = spectrum.sums(values)
    assert found.shape == (count, runs)
    told = by_definition(theta, starts, first + step * np.arange(count), values)
    scale = np.abs(values).sum()
    assert np.abs(found - told).max() < ROUNDED * scale
    # Nearer to the sum that the core takes order by order, whose angles are rounded alike.
    core = _core.unit_sums(theta, values[None, :], starts, first, step, count)
    assert np.abs(found - (core[:, :, 0] + 1j * core[:, :, 1])).max() < ROUNDED * scale


def test_of_small_angles_nothing_but_the_kernel_is_lost():
    rng = np.random.default_rng(20)
    theta = rng.uniform(0.0, 2.0 * np.pi, 2000)
    values = rng.normal(size=2000)
    found = OrderSpectrum(theta, [0], 1.0, 1.0, 512).sums(values)
    told = by_definition(theta, [0], 1.0 + np.arange(512), values)
    assert np.abs(found - told).max() < GRIDDED * np.abs(values).sum()


def test_few_readings_a_run_are_summed_order_by_order():
    rng = np.random.default_rng(4)
    theta, starts = drawn(rng, 90, 3, 2.0)
    values = rng.normal(size=90)
    spectrum = OrderSpectrum(theta, starts, 0.5, 0.25, 64)
    assert spectrum._grid is None
    told = by_definition(theta, starts, 0.5 + 0.25 * np.arange(64), values)
    assert np.abs(spectrum.sums(values) - told).max() < GRIDDED * np.abs(values).sum()


def test_a_line_is_found_at_its_order_and_phase():
    """Of a line of amplitude 1 the sum is half the readings, turned by its phase."""
    n, order, phase = 6000, 7.3, 0.4
    theta = np.linspace(0.0, 20.0 * np.pi, n, endpoint=False)  # 73 whole periods
    spectrum = OrderSpectrum(theta, [0], 0.3, 0.1, 400)
    sums = spectrum.sums(np.cos(order * theta + phase))[:, 0]
    best = int(np.argmax(np.abs(sums)))
    assert best == 70
    assert abs(sums[best] - 0.5 * n * np.exp(1j * phase)) < GRIDDED * n
