"""Readings that are put aside in rows are no glitches, and are not forgotten."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

ASIDE = "put aside in a row"


def one_way(error_of, noise_of, rng, samples=1000):
    runs = []
    for k, speed in enumerate((7.0, 24.0, 11.0, 31.0, 15.0)):
        travel = np.linspace(0.0, 400.0, samples)
        theta = rng.uniform(0.0, 360.0) + travel
        error = noise_of(samples, rng) + error_of(travel)
        runs.append(
            ta.CalibrationRun(
                theta, theta + error / 3600.0, period=360.0, time=travel / speed, label=f"run {k}"
            )
        )
    return runs


def white(n, rng):
    return rng.normal(size=n)


def heavy_and_correlated(n, rng):
    noise = rng.standard_t(3, n)
    for i in range(1, n):
        noise[i] += 0.8 * noise[i - 1]
    return noise


@pytest.mark.parametrize("seed", [44_101, 44_103, 44_107])
def test_what_settles_over_many_readings_is_not_understood(seed):
    """All were clipped as outliers: 5 arcsec rms were left, and nothing was said of them."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    runs = one_way(lambda travel: -60.0 * np.exp(-travel / 6.3), white, rng)
    result = ta.diagnose(runs, Simulation())
    assert [f.cause for f in result.findings if f.confirmed] == []
    assert result.unexplained.found


@pytest.mark.parametrize("seed", [44_111, 44_113, 44_117, 44_119])
def test_heavy_tails_and_memory_put_nothing_aside_in_a_row(seed):
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    result = ta.diagnose(one_way(np.zeros_like, heavy_and_correlated, rng), Simulation())
    assert ASIDE not in [item.test for item in result.unexplained.firing]
