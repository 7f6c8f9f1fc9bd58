"""Signals of a time before: read off the record, or from the speed."""

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.joint.earlier import earlier_signals
from trueangle.joint.signals import join_runs


def signals(step):
    """A joint that gathers speed and turns back: 50 deg/s^2 up to 2 s, then down."""
    time = np.arange(0.0, 11.0, step)
    angle = np.where(
        time < 4.0, 25.0 * time**2, 400.0 - 25.0 * (time - 4.0) ** 2 + 200.0 * (time - 4.0)
    )
    reference = np.radians(angle)
    return join_runs([CalibrationRun(reference=reference, indicated=reference, time=time)]), time


@pytest.mark.parametrize("delay", [0.05, -0.05])
def test_close_readings_are_read_off_their_own_record(delay):
    found, time = signals(0.01)
    then = earlier_signals(found, delay)
    inside = (time - delay > 0.0) & (time - delay < 10.9)
    wanted = np.interp(time - delay, time, found.degrees)
    assert np.abs(then.degrees - wanted)[inside].max() < 1e-9
    # By the speed alone an acceleration would leave half of a tau^2.
    by_speed = found.degrees - found.velocity * delay
    assert np.abs(by_speed - wanted)[inside].max() > 0.03


def test_the_direction_is_that_of_the_time_before():
    found, time = signals(0.01)
    then = earlier_signals(found, 0.1)
    turned = time[np.flatnonzero(np.diff(found.direction))]
    later = time[np.flatnonzero(np.diff(then.direction))]
    assert turned.size == 1
    assert later == pytest.approx(turned + 0.1, abs=0.011)


def test_readings_farther_apart_follow_the_speed():
    found, _ = signals(0.5)
    then = earlier_signals(found, 0.1)
    assert then.degrees == pytest.approx(found.degrees - 0.1 * found.velocity)
    assert (then.direction == found.direction).all()


def test_no_delay_is_no_change():
    found, _ = signals(0.01)
    assert (earlier_signals(found, 0.0).theta == found.theta).all()


@pytest.mark.parametrize("delay", [0.07, 0.1, -0.035])
def test_every_signal_is_that_of_the_last_reading_before(delay):
    """Reading by reading, in two runs: nothing comes over the border between them."""
    one, time = signals(0.01)
    found = one.followed_by(one)
    then = earlier_signals(found, delay)
    n = time.size
    for k in range(0, 2 * n, 7):
        start, at = (k // n) * n, time[k % n] - delay
        before = np.flatnonzero(time <= at)
        last = start + (int(before[-1]) if before.size else 0)
        for name in ("direction", "travel", "segment"):
            assert getattr(then, name)[k] == getattr(found, name)[last], name
        if time[0] <= at <= time[-1]:
            own = slice(start, start + n)
            wanted = np.interp(at, time, found.velocity[own])
            assert then.velocity[k] == pytest.approx(wanted, abs=1e-9)
        else:
            assert then.velocity[k] == found.velocity[k]
