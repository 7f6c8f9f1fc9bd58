"""The step of a compensator: every way of calling it, what holds it and what it holds."""

from __future__ import annotations

import copy
import gc
import math
import pickle
import sys

import numpy as np
import pytest

import trueangle as ta
from trueangle._core import Compensator, Series
from trueangle.errors import ArgumentError


def series(size: float = 0.03) -> Series:
    return Series(360.0, 0.25, [1.0], [[1, 2, 17]], [[size, -0.02, 0.001]], [[0.0, 0.05, 0.0]])


#: Those of a model that needs none, the angle of another joint among them.
SIGNALS = {"velocity": 1.0, "coupled_b": None}


@pytest.fixture
def step():
    shaft = ta.Shaft("output", 1.0, (1, 2, 17), (0.03, -0.02, 0.001), (0.0, 0.05, 0.0))
    return ta.HarmonicModel([shaft], period=360.0, constant=0.25).compensator()


class Angle(float):
    """A float of another class, as numpy's."""

    def __float__(self) -> float:
        raise AssertionError("a float is taken as it is")


def test_every_way_of_calling_gives_the_same_bits(step):
    expected = series().correct(123.456)
    assert [step(123.456), step(Angle(123.456)), step(np.float64(123.456))] == [expected] * 3
    assert list(map(step, [123.456] * 3)) == [expected] * 3
    assert step.__call__(123.456) == expected
    assert step(*[123.456]) == expected
    assert step(123.456, 1.0, None, torque=np.float64(2.0)) == expected
    assert step(*[123.456], **SIGNALS) == expected
    assert step(7) == step(np.int16(7)) == step(7.0)
    assert step(np.float32(0.5)) == step(np.array(0.5)) == step(0.5)
    for nothing in (math.nan, math.inf, -math.inf, np.float64(math.nan)):
        assert math.isnan(step(nothing))


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda step: step(), TypeError, "up to 5 signals, got 0 arguments"),
        (lambda step: step(*[1.0] * 7), TypeError, "got 7 arguments"),
        (lambda step: step.__call__(), TypeError, "got 0 arguments"),
        (lambda step: step(1.0, speed=2.0), TypeError, "keyword argument 'speed'"),
        (lambda step: step(torque=2.0), TypeError, "got 0 arguments"),
        (lambda step: step.__call__(1.0, speed=2.0), TypeError, "keyword argument 'speed'"),
        (lambda step: step("1"), ArgumentError, "one real number, got 1 of type str"),
        (lambda step: step(True), ArgumentError, "one real number"),
        (lambda step: step([1.0]), ArgumentError, "one real number"),
        (lambda step: step(10**400), ArgumentError, "range of doubles"),
        (lambda step: type(step)(), TypeError, "cannot create"),
        (lambda step: setattr(step, "swap", None), AttributeError, "read"),
    ],
)
def test_a_wrong_call_is_refused_and_the_next_one_is_right(step, call, error, says):
    with pytest.raises(error, match=says):
        call(step)
    assert step(123.456) == series().correct(123.456)


def test_copies_step_alike_and_are_exchanged_apart(step):
    other = ta.HarmonicModel([ta.Shaft("output", 1.0, (1,), (0.1,), (0.0,))], period=360.0)
    for again in (pickle.loads(pickle.dumps(step)), copy.deepcopy(step)):
        assert again(12.5) == step(12.5)
        again.swap(other)
        assert again(12.5) == other.correct(12.5) != step(12.5)


def test_a_swap_lets_go_of_what_it_replaces():
    first, second = series(), series(0.01)
    counts = [sys.getrefcount(first), sys.getrefcount(second)]
    compensator = Compensator(first)
    step = compensator.step
    for _ in range(3):
        step.swap(second)
        assert step(12.5) == second.correct(12.5)
        step.swap(first)
        assert step(12.5) == first.correct(12.5)
    assert sys.getrefcount(second) == counts[1]
    del step, compensator
    assert sys.getrefcount(first) == counts[0]


def test_a_step_that_is_held_by_what_it_holds_is_collected():
    class Holder:
        def swap(self, _: object) -> None: ...

    gc.collect()
    before = sum(type(held).__name__ == "Step" for held in gc.get_objects())
    for _ in range(3):
        holder = Holder()
        holder.step = Compensator(series()).step_with(holder.swap)
        assert holder.step.swap.__self__ is holder
    del holder
    gc.collect()
    assert sum(type(held).__name__ == "Step" for held in gc.get_objects()) == before
