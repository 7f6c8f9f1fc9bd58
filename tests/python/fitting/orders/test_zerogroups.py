"""Passes of one run: whole turns of its way, however it went."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from trueangle.fitting.orders.zerogroups import ZeroGroupReadings, passes_of_run

TURN = np.arange(40) / 40.0
#: To the end of a turn and back, each end read twice.
THERE_AND_BACK = np.concatenate([TURN, TURN[::-1]])


def passes(path: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Places in the run of the readings of each pass."""
    number = np.arange(path.size, dtype=float)
    unit = ZeroGroupReadings(path % 1.0, number, np.ones(path.size), "")
    return [part.error for part in passes_of_run(unit, path)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("start", [0.0, 0.37, -5.2])
def test_each_turn_is_a_pass(start: float, sign: float) -> None:
    path = start + sign * np.arange(120) / 40.0
    found = passes(path)
    assert [part.size for part in found] == [40, 40, 40]
    np.testing.assert_array_equal(np.concatenate(found), np.arange(120))


def test_there_and_back_are_two() -> None:
    found = passes(THERE_AND_BACK)
    assert len(found) == 2
    assert [abs(part.size - 40) <= 1 for part in found] == [True, True]


@pytest.mark.parametrize(("readings", "sizes"), [(59, []), (61, [40, 21]), (99, [40, 40])])
def test_half_a_turn_at_the_end_is_a_pass_and_less_is_none(readings: int, sizes: list[int]) -> None:
    assert [part.size for part in passes(np.arange(readings) / 40.0)] == sizes


@pytest.mark.parametrize(("turns", "each"), [(32, 1), (33, 2), (65, 3), (640, 20)])
def test_of_many_turns_as_many_are_taken_together(turns: int, each: int) -> None:
    found = passes(np.arange(40 * turns) / 40.0)
    assert {part.size for part in found[:-1]} == {40 * each}
    assert sum(part.size for part in found) == 40 * turns


def test_places_in_any_order_are_no_passes() -> None:
    rng = np.random.default_rng(3)
    assert passes(rng.permutation(np.tile(TURN, 5))) == []
    assert passes(np.zeros(0)) == []
    assert passes(np.array([0.0, 1.0])) == []


def test_a_new_pass_begins_where_readings_are_left_out() -> None:
    """Blocks of a long run, far apart: of each its whole turns, and what is half of one or more."""
    blocks = [np.arange(60) / 40.0, 10.3 + np.arange(90) / 40.0, 30.8 + np.arange(30) / 40.0]
    found = passes(np.concatenate(blocks))
    assert [part.size for part in found] == [40, 40, 40, 30]
    assert [part[0] for part in found] == [0, 60, 100, 150]
