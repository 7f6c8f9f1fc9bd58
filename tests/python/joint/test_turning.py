"""Direction and speed about a turning point that only the reference tells."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.joint.signals import join_runs


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
