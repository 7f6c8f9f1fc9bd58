"""Distinct values, as numpy tells them."""

import numpy as np
import pytest

from trueangle.support.arrays import distinct


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
