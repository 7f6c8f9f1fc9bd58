"""Direction and speed about a turning point that only the reference tells."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.joint.signals import join_runs
from trueangle.joint.turning import direction_at_turns, velocity_at_turns


def there_and_back(phase: float, acceleration: float = np.inf) -> tuple[CalibrationRun, np.ndarray]:
    """A run that turns between two readings, and its true velocities."""
    time = np.arange(60.0) * 0.1 + 0.1 * phase
    away = np.abs(time - 3.0)
    angle, speed = 40.0 - 20.0 * away, np.full(60, 20.0)
    if np.isfinite(acceleration):
        ramp = 20.0 / acceleration  # seconds from rest to full speed
        slow = away < ramp
        angle = np.where(slow, 40.0 - 10.0 * ramp - 10.0 * away**2 / ramp, angle)
        speed = np.where(slow, 20.0 * away / ramp, speed)
    run = CalibrationRun(angle, angle, period=360.0, time=time)
    return run, -np.sign(time - 3.0) * speed


@pytest.mark.parametrize("phase", [0.02, 0.2, 0.45, 0.55, 0.8, 0.98])
def test_every_reading_of_a_sharp_turn_has_its_side(phase: float) -> None:
    run, velocity = there_and_back(phase)
    signals = join_runs([run])
    np.testing.assert_array_equal(signals.direction, np.sign(velocity))
    assert signals.velocity is not None
    np.testing.assert_allclose(signals.velocity, velocity, atol=1e-9)
    # Travel starts at the reading that is farthest out, on either side: within a step.
    assert signals.travel[signals.segment == 1].min() < 2.0


@pytest.mark.parametrize("phase", [0.2, 0.45, 0.8])
def test_a_turn_that_takes_its_time(phase: float) -> None:
    run, velocity = there_and_back(phase, acceleration=40.0)
    signals = join_runs([run])
    # A reading that all but rests at the turning point may have either side.
    moving = np.abs(velocity) > 2.0
    np.testing.assert_array_equal(signals.direction[moving], np.sign(velocity)[moving])
    assert signals.velocity is not None
    inside = np.abs(np.arange(60) - 30) < 4
    np.testing.assert_allclose(signals.velocity[inside], velocity[inside], atol=1e-9)


def test_a_joint_that_stops_at_its_readings_came_the_way_it_came() -> None:
    # Point to point: back past the middle of the last step, one reading a second.
    angle = np.concatenate([np.arange(0.0, 351.0, 10.0), np.arange(335.0, -1.0, -10.0)])
    signals = join_runs([CalibrationRun(angle, angle, period=360.0)])
    assert signals.direction[35] == 1.0
    assert signals.direction[36] == -1.0


def test_what_was_logged_is_not_put_right() -> None:
    run, _ = there_and_back(0.2)
    logged = np.where(np.arange(60) < 20, 1.0, -1.0)
    given = CalibrationRun(
        run.reference, run.indicated, period=360.0, time=run.time, velocity=logged
    )
    np.testing.assert_array_equal(join_runs([given]).direction, logged)


def turning_at(when: float, size: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Angles that turn back at a time, and the signs of the steps that led to them."""
    clock = np.arange(float(size))
    angle = 10.0 - 4.0 * np.abs(clock - when)
    return angle, np.sign(np.diff(angle, prepend=-np.inf))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("when", [1.8, 3.2, 3.8, 5.8, 6.2])
def test_the_reading_farthest_out_is_put_right(when: float, sign: float) -> None:
    angle, steps = turning_at(when)
    clock = 0.5 * np.arange(9.0) + 100.0
    found = direction_at_turns(sign * angle, clock, sign * steps)
    np.testing.assert_array_equal(found, sign * np.where(np.arange(9.0) < when, 1.0, -1.0))


def test_two_readings_on_either_side_are_needed() -> None:
    # The stretch after the turn has one reading, or the one before it two.
    for when, size in ((6.8, 8), (1.2, 9), (0.9, 9)):
        angle, steps = turning_at(when, size)
        np.testing.assert_array_equal(direction_at_turns(angle, np.arange(size), steps), steps)
    # Of a joint that stopped there both lines say alike: it came the way it came.
    for share, turned in ((0.45, True), (0.55, False)):
        angle, steps = turning_at(3.0)
        before, after = angle[2] + 4.0, angle[4] + 4.0
        assert before == after
        angle[:3] += 1.0  # the line before says one more than the line after
        angle[3] = after + share / (1.0 + share)
        steps = np.sign(np.diff(angle, prepend=-np.inf))
        assert (direction_at_turns(angle, np.arange(9.0), steps)[3] == -1.0) == turned


def test_equal_times_are_no_slope() -> None:
    """The line through two readings of one time is level at the nearer one's angle."""
    angle, steps = turning_at(4.8)
    clock = np.arange(9.0)
    clock[3] = clock[4]
    # Before: level at reading 3, 6.4 below reading 5; after: exact.
    assert direction_at_turns(angle, clock, steps)[5] == -1.0
    clock = np.arange(9.0)
    clock[7] = clock[6]
    # After: level at reading 6, 4 below; before: 13.2 - 9.2 = 1.6 above.
    assert direction_at_turns(angle, clock, steps)[5] == 1.0


@pytest.mark.parametrize("when", [2.6, 4.4, 5.4])
def test_beside_a_turn_the_speed_is_that_of_the_parabola(when: float) -> None:
    """A parabola on either side: its slope at the last and the first reading is exact."""
    rng = np.random.default_rng(11)
    time = np.cumsum(rng.uniform(0.5, 1.5, 9))
    turn = np.interp(when, np.arange(9.0), time)
    away = time - turn
    angle = np.where(away < 0.0, 3.0 * away - 0.2 * away**2, -2.0 * away + 0.1 * away**2)
    slope = np.where(away < 0.0, 3.0 - 0.4 * away, -2.0 + 0.2 * away)
    direction = np.where(away < 0.0, 1.0, -1.0)
    rough = np.gradient(angle, time)
    found = velocity_at_turns(angle, time, direction, rough)
    beside = np.isin(np.arange(9.0), [np.floor(when), np.ceil(when)])
    np.testing.assert_allclose(found[beside], slope[beside], atol=1e-9)
    np.testing.assert_array_equal(found[~beside], rough[~beside])


def test_a_stretch_of_two_readings_has_no_parabola() -> None:
    time = np.arange(8.0)
    direction = np.array([1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    rough = np.full(8, 7.0)
    angle = np.array([0.0, 1.0, 0.5, -2.0, -4.0, -3.0, -1.0, 2.0])
    found = velocity_at_turns(angle, time, direction, rough)
    assert found.tolist() == [7.0, 7.0, -2.75, 7.0, -1.75, 1.5, 7.0, 7.0]


def test_slopes_where_times_are_equal() -> None:
    direction = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    angle = np.array([0.0, 2.0, 6.0, 5.0, 1.0, 0.0])
    for last, slope in ((5.0, -5.0 / 2.0), (3.0, 0.0)):
        time = np.array([0.0, 1.0, 2.0, 3.0, 3.0, last])
        found = velocity_at_turns(angle, time, direction, np.zeros(6))
        assert found[3] == slope
    # The second and third reading share their time: the secant to the third.
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.0])
    assert velocity_at_turns(angle, time, direction, np.zeros(6))[3] == -5.0
