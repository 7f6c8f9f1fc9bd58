"""Medians and quantiles against numpy's own, bit for bit."""

import numpy as np
import pytest

from trueangle.support.arrays import median, quantile

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
