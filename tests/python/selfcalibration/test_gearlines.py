"""Both readings of a geared joint: lines, ratio, direction, and what they are numbers of."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.errors import NoModelError
from trueangle.selfcalibration.dualfit import DualSample, dual_rows, fit_dual_lines
from trueangle.selfcalibration.gearlines import (
    GearedChannels,
    SharedLine,
    gear_motion,
    geared_channels,
    lines_of_gear,
    motion_varies,
    near_reversal,
    slope_ratio,
)
from trueangle.selfcalibration.projected import Unknown
from trueangle.selfcalibration.recording import Recording

TURN = 2.0 * math.pi


def there_and_back(n: int = 800, ratio: float = 20.5, seed: int = 1) -> GearedChannels:
    theta = np.concatenate([np.linspace(0.0, 5.0, n // 2), np.linspace(5.0, 0.0, n // 2)])
    noise = 1e-5 * np.random.default_rng(seed).normal(size=n)
    output = theta + 0.3 + 2e-3 * np.sin(theta + 0.3) + 5e-4 * np.cos(2.0 * ratio * theta) + noise
    return GearedChannels([ratio * theta], [output], [np.arange(n) / 100.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("turns", [0.8, 30.0])
def test_lines_that_the_travel_cannot_part_stand_once(sign: float, turns: float) -> None:
    ratio = sign * 2.01
    found = lines_of_gear("auto", ratio, turns)
    assert [line.order for line in found] == sorted(line.order for line in found)
    by_order = {line.order: line for line in found}
    for j in range(1, 9):
        order = 2.01 * j
        near = round(order)
        if abs(order - near) * turns < 0.05:
            assert by_order[float(near)] == SharedLine(near, near, j)
        else:
            assert by_order[order] == SharedLine(order, 0, j)
    near = {round(2.01 * j): abs(2.01 * j - round(2.01 * j)) * turns < 0.05 for j in range(1, 9)}
    shared = {order for order, one in near.items() if one}
    assert {line.output for line in found} - {0} == set(range(1, 9)) | shared
    assert [line.motor for line in found if line.motor] == list(range(1, 9))
    # Of those asked for no others of the output, unless the motor shares them.
    some = lines_of_gear([3.0], 2.0, 1.0)
    assert [(line.output, line.motor) for line in some] == [
        (2, 1), (3, 0), (4, 2), (6, 3), (8, 4), (10, 5), (12, 6), (14, 7), (16, 8),
    ]  # fmt: skip
    assert [line.motor for line in lines_of_gear([], 0.3, 1.0)] == list(range(1, 9))
    # One turn of the motor a turn of the output: order 1 is shared as well.
    assert lines_of_gear([], 1.0, 100.0)[0] == SharedLine(1.0, 1, 1)


def test_what_a_number_is_a_number_of() -> None:
    assert SharedLine(2.0, 2, 1).of.startswith("output 2 + motor 1 (output encoder, motor encoder")
    assert SharedLine(2.0, 2, 0).of == "output 2 (output encoder or gear)"
    assert SharedLine(40.0, 0, 2).of == "motor 2 (motor encoder or gear)"


@pytest.mark.parametrize("ratio", [20.5, -3.0])
def test_the_slope_is_the_ratio_whatever_the_zeros(ratio: float) -> None:
    theta = [np.linspace(0.0, 3.0, 50), np.linspace(4.0, 1.0, 70)]
    channels = GearedChannels([ratio * t + 9.0 * k for k, t in enumerate(theta)],
                        [t - 5.0 * k for k, t in enumerate(theta)], [None, None])  # fmt: skip
    assert slope_ratio(channels) == pytest.approx(ratio, rel=1e-12)
    still = GearedChannels([np.arange(5.0)], [np.zeros(5)], [None])
    with pytest.raises(NoModelError, match="does not move with the motor"):
        slope_ratio(still)


def test_channels_are_unwrapped_and_named() -> None:
    angle = np.linspace(0.0, 3.0 * TURN, 100)
    wrapped = Recording("a", None, np.mod(angle, TURN), None, np.mod(angle * 2.0, TURN))
    (motor,), (output,), (time,) = geared_channels([wrapped])
    np.testing.assert_allclose(np.diff(output), np.diff(angle))
    np.testing.assert_allclose(np.diff(motor), 2.0 * np.diff(angle))
    assert time is None
    counted = geared_channels([Recording("a", angle, None, angle, angle * 2.0)])
    assert counted.output[0] is angle
    assert counted.time[0] is angle
    for lacking in (Recording("a", None, angle), Recording("a", motor=angle)):
        with pytest.raises(NoModelError, match="run a: both readings are needed"):
            geared_channels([lacking])


@pytest.mark.parametrize("uneven", [0.0, 0.3])
def test_the_speed_of_a_swing_is_no_less_for_its_curvature(uneven: float) -> None:
    """A swing in 700 readings: a difference over 21 is 0.13 % too small, a cubic 3e-6."""
    time = np.arange(1400) / 100.0
    time += uneven / 100.0 * np.sin(2.0 * np.pi * np.arange(1400) / 350.0)
    way, speed = gear_motion(np.sin(2.0 * np.pi * time / 7.0), time)
    true = 2.0 * np.pi / 7.0 * np.cos(2.0 * np.pi * time / 7.0)
    inside = slice(10, -10)
    np.testing.assert_allclose(speed[inside], true[inside], atol=2e-5)
    assert (np.sign(true[20:-20]) == way[20:-20]).mean() > 0.99


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_direction_and_speed_of_the_motion(sign: float) -> None:
    time = np.arange(400) / 50.0
    theta = sign * np.where(time < 4.0, 0.5 * time**2, 16.0 - 0.5 * (8.0 - time) ** 2 - 0.0)
    way, speed = gear_motion(theta, time)
    assert (way == sign).all()
    inside = slice(12, -12)
    true = sign * np.where(time < 4.0, time, 8.0 - time)
    np.testing.assert_allclose(speed[inside], true[inside], atol=0.11)
    assert (speed[:10] == speed[10]).all()
    assert (speed[-10:] == speed[-11]).all()
    back, none = gear_motion(sign * np.concatenate([time, time[::-1]]), None)
    assert back[:398].tolist() == [sign] * 398
    assert back[402:].tolist() == [-sign] * 398
    assert not none.any()
    still = gear_motion(np.full(30, 2.0), np.arange(30.0))
    assert not still[0].any()
    assert not still[1].any()
    # Of equal times no speed is told, of few readings by two to either side, of fewer none.
    assert not gear_motion(np.arange(30.0), np.zeros(30))[1].any()
    for few in (5, 12):
        steady = np.arange(float(few))
        np.testing.assert_allclose(gear_motion(3.0 * steady, steady)[1], 3.0)
    assert not gear_motion(np.arange(4.0), np.arange(4.0))[1].any()


def test_readings_near_a_reversal() -> None:
    for at in (1, 6, 11):
        way = np.where(np.arange(12) < at, 1.0, -1.0)
        near = [abs(k - (at - 0.5)) < 3.0 for k in range(12)]
        assert near_reversal(way).tolist() == near
    assert not near_reversal(np.ones(9)).any()


def test_directions_and_speeds_that_vary() -> None:
    time = np.arange(400) / 50.0
    ramp = 0.5 * time**2
    both = GearedChannels(
        [20.0 * np.concatenate([ramp, ramp[::-1]])], [ramp], [np.arange(800) / 50.0]
    )
    assert motion_varies(both, 20.0) == (True, True)
    assert motion_varies(GearedChannels([20.0 * ramp], [ramp], [time]), 20.0) == (False, True)
    assert motion_varies(GearedChannels([20.0 * time], [time], [time]), 20.0) == (False, False)
    assert motion_varies(GearedChannels([20.0 * ramp], [ramp], [None]), 20.0) == (False, False)
    two = GearedChannels([20.0 * ramp, 20.0 * ramp], [ramp, ramp], [time, None])
    assert motion_varies(two, 20.0) == (False, False)


@pytest.mark.parametrize("size", [7, 100])
def test_samples_part_the_readings(size: int) -> None:
    assert DualSample().of(size).all()
    for blocks in (2, 5, 6):
        even, odd = DualSample(blocks, 0).of(size), DualSample(blocks, 1).of(size)
        assert (even ^ odd).all()
        assert even[0]
        assert np.count_nonzero(np.diff(even)) == blocks - 1
        assert odd[-1] == (blocks % 2 == 0)


@pytest.mark.parametrize("slope", [False, True])
def test_lines_are_fitted_beside_zero_direction_and_speed(slope: bool) -> None:
    """What is hidden comes back with its sign, phase and ratio."""
    channels = there_and_back()
    lines = [SharedLine(1.0, 1, 0), SharedLine(41.0, 0, 2)]
    ratio = 20.5 * (1.0 + 1e-5 * slope)
    found = fit_dual_lines(channels, ratio, lines, slope=slope)
    std = np.sqrt(np.diagonal(found.dense.covariance))
    expected = [0.0, 2e-3, 5e-4, 0.0] + [1e-5] * slope
    assert (np.abs(found.dense.patterns - expected) < 4.5 * std).all()
    assert (std[:4] < 3e-6).all()
    assert found.zeros[0] == pytest.approx(0.3, abs=1e-4)
    assert [c.order for c in found.dense.projected.columns[:4]] == [1.0, 1.0, 41.0, 41.0]
    assert (found.dense.projected.columns[-1] == Unknown("the gear ratio", 0.0, "")) == slope
    mirrored = GearedChannels([-channels.motor[0]], [-channels.output[0]], channels.time)
    other = fit_dual_lines(mirrored, ratio, lines, slope=slope)
    # Mirrored: cosines change their sign, sines and the slope do not.
    signs = [-1.0, 1.0, -1.0, 1.0] + [1.0] * slope
    np.testing.assert_allclose(other.dense.patterns, found.dense.patterns * signs, atol=1e-9)
    np.testing.assert_allclose(other.dense.covariance.diagonal(), std**2, rtol=1e-6)


def test_rows_hold_their_nuisances_in_order() -> None:
    channels = there_and_back()
    rows = list(dual_rows(channels, 20.5, [SharedLine(1.0, 1, 0)], (0.3,), slope=True))
    whole = np.concatenate([r.nuisances for r in rows])
    known = ~near_reversal(gear_motion(channels.motor[0] / 20.5, channels.time[0])[0])
    assert len(whole) == np.count_nonzero(known) == 800 - 6
    theta = channels.motor[0][known] / 20.5
    patterns = np.concatenate([r.patterns for r in rows])
    np.testing.assert_allclose(patterns[:, 0], np.cos(theta + 0.3))
    np.testing.assert_allclose(patterns[:, 1], np.sin(theta + 0.3))
    np.testing.assert_allclose(patterns[:, 2], theta - np.mean(channels.motor[0] / 20.5))
    np.testing.assert_array_equal(whole[:, 0], np.where(np.flatnonzero(known) < 400, 1.0, -1.0))
    assert (whole[:, -1] == 1.0).all()
    target = np.concatenate([r.target for r in rows])
    np.testing.assert_allclose(target, channels.output[0][known] - theta - 0.3)
    motor = np.concatenate(
        [r.patterns for r in dual_rows(channels, -20.5, [SharedLine(41.0, 0, 2)], (0.0,))]
    )
    np.testing.assert_allclose(motor[:, 1], np.sin(-2.0 * channels.motor[0][known]))
    half = list(dual_rows(channels, 20.5, [], (0.3,), DualSample(2, 1)))
    assert sum(len(r.target) for r in half) == np.count_nonzero(known[400:])
