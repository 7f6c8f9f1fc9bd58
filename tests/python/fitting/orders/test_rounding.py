"""Orders of a coarse sensor at even positions: those of the joint, none of the rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from coarse import Sensor, any_sensor
from trueangle.fitting.orders.selection import orders_beyond_rounding
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings


@pytest.mark.parametrize("seed", range(40, 70))
def test_orders_are_those_of_the_joint(seed):
    """Of 91 such models 42 had held orders of the rounding, and 22 made the joint worse."""
    sensor = any_sensor(seed)
    print(sensor)
    chosen = ta.select_orders(sensor.read())
    if sensor.amplitude >= 1.0:
        assert chosen.orders == (sensor.order,)
    elif sensor.amplitude > 0.0:
        assert set(chosen.orders) <= {sensor.order}
    else:
        assert chosen.orders == ()


def test_what_the_rounding_makes_is_said_to_be_its():
    sensor = Sensor(12, 36, 1, False, 0.0, 0.0, 1, 3)
    chosen = ta.select_orders(sensor.read())
    assert chosen.orders == ()
    assert "rounding to whole steps" in chosen.reason
    verdicts = {row.order: row.verdict for row in chosen.table}
    # 4096 counts on 36 positions: nine levels, four times, as orders 4, 8, 16 ... have them.
    assert "rounding" in verdicts.values()
    assert not chosen.row(4).retained


def units(error: np.ndarray) -> list[ZeroGroupReadings]:
    turns = np.arange(error.size) / error.size
    return [ZeroGroupReadings(turns, error, np.ones(error.size), "1")]


def test_orders_always_in_the_model_are_not_told_of():
    """A line that the reference makes takes its share first."""
    x = 2.0 * np.pi * np.arange(72) / 72
    truth = 2.0 * np.cos(2.0 * x) + 1.5 * np.sin(5.0 * x)
    reading = np.round(7.3 * x + truth) - 7.3 * x
    limit = math.log(0.005 / 17)
    assert orders_beyond_rounding(units(reading), 1.0, [2, 5, 9], limit) == [0, 1]
    assert orders_beyond_rounding(units(reading), 1.0, [2, 5, 9], limit, forced=1) == [1]


def test_fine_steps_and_steps_that_are_none_leave_the_orders():
    rng = np.random.default_rng(4)
    x = 2.0 * np.pi * np.arange(72) / 72
    reading = 0.3 * np.cos(2.0 * x) + rng.normal(0.0, 0.3, 72)
    for step in (0.1, 100.0):
        assert orders_beyond_rounding(units(reading), step, [2, 7], -9.0) == [0, 1]
