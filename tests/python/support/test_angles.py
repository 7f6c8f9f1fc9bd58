"""Means of angles and sums over a circle against ten lines of numpy."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.support.angles import arcsec, circular_mean, power_sums, unit_name, wrap, zero_text

PERIODS = {360.0: "deg", 2.0 * np.pi: "rad", 1.0: "turn", 4096.0: "count"}


@pytest.mark.parametrize("period", PERIODS)
def test_means_are_those_of_unit_vectors(period: float) -> None:
    rng = np.random.default_rng(41)
    angle = period * (0.98 + rng.normal(0.0, 0.1, 30))
    for x in (angle, np.mod(angle, period), angle - 7.0 * period):
        turns = 2.0 * np.pi * x / period
        mean = np.arctan2(np.sin(turns).mean(), np.cos(turns).mean()) * period / (2.0 * np.pi)
        assert circular_mean(x, period) == pytest.approx(mean, abs=1e-9 * period)
    # Weights in whole numbers are repeated readings.
    times = rng.integers(0, 5, angle.size)
    repeated = circular_mean(np.repeat(angle, times), period)
    assert circular_mean(angle, period, times) == pytest.approx(repeated, abs=1e-12 * period)
    assert circular_mean(-angle, period) == pytest.approx(-circular_mean(angle, period))
    assert unit_name(period) == PERIODS[period]
    assert arcsec(period / 12.0, period) == pytest.approx(108_000.0)
    wrapped = wrap(angle * 9.0, period)
    assert np.abs(wrapped).max() <= 0.5 * period
    np.testing.assert_allclose(np.exp(2j * np.pi * (wrapped - 9.0 * angle) / period), 1.0)


@pytest.mark.parametrize("period", PERIODS)
def test_a_zero_is_written_to_a_hundredth_of_an_arcsecond(period: float) -> None:
    for seconds in (123.456789, -0.004, 0.031):
        number, unit = zero_text(seconds * period / 1_296_000.0, period).split()
        assert unit == PERIODS[period]
        assert arcsec(float(number), period) == pytest.approx(seconds, abs=0.00501)


@pytest.mark.parametrize("points", [1, 511, 512, 513, 1300])
@pytest.mark.parametrize("count", [1, 63, 64, 65, 300])
def test_power_sums_are_the_sums_of_their_definition(points: int, count: int) -> None:
    """At every border of blocks and of fresh powers, far from zero, and mirrored."""
    rng = np.random.default_rng([points, count])
    turns = rng.uniform(-900.0, 900.0, points)
    columns = rng.normal(size=(points, 2))
    found = power_sums(turns, columns, count)
    slow = np.exp(2j * np.pi * np.outer(np.arange(count), turns - np.floor(turns))) @ columns
    limit = 1e-12 * np.abs(columns).sum(axis=0)
    assert found.shape == (count, 2)
    assert (np.abs(found - slow) < limit).all()
    assert (np.abs(power_sums(-turns, columns, count) - slow.conj()) < limit).all()
