"""Counting turns over borders: numpy.unwrap of the whole record is the oracle."""

import numpy as np
import pytest

from trueangle.logs.turns import TurnCounter, TurnSpan, TurnState

from .conftest import made_angles


@pytest.mark.parametrize("cut", [1, 7, 333, 500, 999])
def test_batches_count_as_numpy_unwraps_the_whole(cut):
    angles = made_angles(1000, turns=7.3)
    counter = TurnCounter(360.0)
    parts = [counter.count(angles[i : i + cut]) for i in range(0, 1000, cut)]
    expected = np.rint((np.unwrap(angles, period=360.0) - angles) / 360.0)
    np.testing.assert_array_equal(np.concatenate(parts), expected)


def test_a_border_right_at_the_wrap_counts_one_turn():
    counter = TurnCounter(360.0)
    assert counter.count(np.array([358.0, 359.5])).tolist() == [0, 0]
    assert counter.count(np.array([0.5, 1.0])).tolist() == [1, 1]
    assert counter.count(np.array([359.9])).tolist() == [0]
    assert counter.count(np.array([0.0])).tolist() == [1]


def test_missing_readings_are_stepped_over_also_at_borders():
    counter = TurnCounter(360.0)
    assert counter.count(np.array([np.nan, 350.0, np.nan])).tolist() == [0, 0, 0]
    assert counter.count(np.array([np.nan, np.nan])).tolist() == [0, 0]
    assert counter.count(np.array([np.nan, 10.0, np.nan, 340.0])).tolist() == [0, 1, 1, 0]
    assert counter.state == TurnState(340.0, 0)


def test_angles_of_many_turns_are_left_alone():
    assert not TurnCounter(360.0).count(np.linspace(-5000.0, 5000.0, 200)).any()


def test_parts_counted_by_themselves_join_to_the_whole():
    angles = made_angles(1000, turns=-5.2)
    whole = TurnCounter(360.0)
    whole.count(angles)
    state = TurnState()
    for part in np.array_split(angles, 6):
        alone = TurnCounter(360.0)
        alone.count(part)
        state = TurnSpan(360.0, float(part[0]), *alone.state).after(state)
    assert state == whole.state
    assert TurnSpan(360.0, None, None, 0).after(state) == state  # nothing but NaN
