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


def test_a_batch_of_nothing_but_gaps_stays_in_its_turn():
    counter = TurnCounter(360.0)
    counter.count(np.array([350.0, 10.0, 120.0, 240.0, 350.0, 10.0]))
    turns = counter.state.turns
    assert turns == 2
    assert counter.count(np.array([np.nan, np.nan])).tolist() == [2, 2]
    assert counter.state.turns == turns


@pytest.mark.parametrize("cut", range(1, 8))
def test_parts_join_across_a_wrap_at_their_border(cut):
    """A wrap at every step: wherever the parts are cut, one lies between them."""
    angles = np.array([100.0, 340.0, 220.0, 100.0, 340.0, 220.0, 100.0, 340.0])
    whole = TurnCounter(360.0)
    whole.count(angles)
    assert whole.state.turns == -3
    state = TurnState()
    for part in (angles[:cut], angles[cut:]):
        alone = TurnCounter(360.0)
        alone.count(part)
        state = TurnSpan(360.0, float(part[0]), *alone.state).after(state)
    assert state == whole.state
