"""Distinct values, as numpy tells them; of those alike but for rounding the first is largest."""

import numpy as np
import pytest

from trueangle.support.arrays import distinct, first_largest


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
