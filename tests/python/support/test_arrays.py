"""Distinct values, as numpy tells them; of those alike but for rounding the first is largest."""

import numpy as np
import pytest

from trueangle.support.angles import arcsec, circular_mean, power_sums, unit_name, wrap, zero_text
from trueangle.support.arrays import distinct, first_largest, median, quantile


@pytest.mark.parametrize("kind", [np.float64, np.int64])
@pytest.mark.parametrize("size", [0, 1, 2, 50])
def test_distinct_values_are_those_of_numpy(kind, size):
    values = np.random.default_rng(size).integers(-5, 5, size).astype(kind)
    found = distinct(values)
    assert found.dtype == values.dtype
    np.testing.assert_array_equal(found, np.unique(values))


def test_values_that_ascend_are_given_back():
    values = np.array([-2.0, 0.5, 3.0])
    assert distinct(values) is values
    assert distinct(np.array([0.5, 0.5, 3.0])).tolist() == [0.5, 3.0]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e12])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rounding_does_not_choose(scale, sign):
    """Three alike to 1e-12; then one that is larger by more than rounding makes."""
    alike = scale * (2.0 * sign + np.array([-1.0, 0.0, 1e-12, -1e-12]))
    assert first_largest(alike) == 1
    larger = alike + np.array([0.0, 0.0, 0.0, 1e-5 * scale])
    assert first_largest(larger) == 3


def test_what_is_endless_loses_or_wins():
    assert first_largest(np.array([-np.inf, 1.0, 1.0])) == 1
    assert first_largest(np.array([1.0, np.inf, np.inf])) == 1
    assert first_largest(np.array([-np.inf, -np.inf])) == 0


SHARES = (0.0, 0.01, 0.25, 0.5, 0.8, 0.9, 1.0)


@pytest.mark.parametrize("count", [1, 2, 3, 10, 57, 1000])
def test_are_numpys(count):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    values = np.random.default_rng(seed).standard_normal((4, count))
    values[1] = np.round(values[1])  # ties
    for axis in (0, 1):
        assert np.array_equal(median(values, axis=axis), np.median(values, axis=axis))
        for share in SHARES:
            ours, theirs = quantile(values, share, axis), np.quantile(values, share, axis=axis)
            assert np.array_equal(ours, theirs), (share, axis)


def test_infinities_and_what_is_no_number():
    assert median([1.0, np.inf]) == np.inf
    assert median([2.0, 1.0, -np.inf]) == 1.0
    assert np.isnan(median([1.0, np.nan, 2.0]))
    assert np.isnan(quantile([np.nan, 1.0, 2.0], 0.1))
    assert np.isnan(median([]))


def test_leave_what_they_are_given():
    values = np.array([3.0, 1.0, 2.0])
    median(values)
    assert values.tolist() == [3.0, 1.0, 2.0]


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
