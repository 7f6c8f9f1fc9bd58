"""Steps of a spin-down: what they take for slopes, against differences of what is left."""

from __future__ import annotations

import numpy as np
import pytest

from selfcalibration.test_segments import TURN, segment
from trueangle.selfcalibration import steady as module
from trueangle.selfcalibration.projected import Unknown
from trueangle.selfcalibration.segments import SegmentReadings
from trueangle.selfcalibration.steady import GaussNewtonSteps

SEED = 69_000
ORDERS, RIPPLE = (1.0, 3.0), (1.0, 2.0)


def work(sets: int, extra: bool) -> tuple[GaussNewtonSteps, np.ndarray]:
    """A coast of 600 readings over 8 turns, and unknowns some mrad in size."""
    rng = np.random.default_rng(SEED)
    time = np.arange(600) / 300.0
    readings = SegmentReadings([segment(time, TURN * (6.0 * time - 1.0 * time**2))])
    if extra:
        readings.extra = rng.normal(size=(1, 600))
        readings.extra_names = ("more",)
    groups = (np.arange(600) // 150) % 2 if sets == 2 else None
    size = sets * 2 * len(ORDERS) + 2 * len(RIPPLE) + extra
    columns = [Unknown(f"{k}", 0.0, "") for k in range(size)]
    found = GaussNewtonSteps(readings, ORDERS, RIPPLE, groups, columns)
    return found, 5e-3 * rng.normal(size=size)


@pytest.mark.parametrize("sets", [1, 2])
def test_slopes_are_those_of_the_error_at_the_corrected_angle(sets: int) -> None:
    """Corrected readings lead back: r = theta + e(theta), and dr / dtheta = 1 + slope."""
    steady, unknowns = work(sets, False)
    angle, rows = steady.readings.angle, slice(None)
    theta, slope = steady.true_angle(angle, unknowns, rows)
    error = np.zeros(angle.size)
    for i in range(sets):
        mask = slice(None) if steady.groups is None else steady.groups == i
        for j, k in enumerate(ORDERS):
            a, b = unknowns[4 * i + 2 * j : 4 * i + 2 * j + 2]
            error[mask] += a * np.cos(k * theta[mask]) + b * np.sin(k * theta[mask])
    np.testing.assert_allclose(theta + error, angle, atol=1e-9)
    ahead, behind = (steady.true_angle(angle + h, unknowns, rows)[0] for h in (1e-4, -1e-4))
    np.testing.assert_allclose(2e-4 / (ahead - behind), 1.0 + slope, rtol=1e-6)


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("sets", [1, 2])
def test_columns_are_what_each_unknown_takes_of_what_is_left(
    sets: int, extra: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Left is weight times (true angle less motion): columns are its slopes, negated."""
    steady, unknowns = work(sets, extra)
    # Of a ripple that is there the place would move with the pattern, a small product.
    unknowns[4 * sets : 4 * sets + 4] = 0.0
    knots = steady.readings.knots(40)
    spline = steady.readings.first_spline(knots)

    class CaughtError(Exception):
        pass

    def caught(knots, index, place, left, weight, write, width, valid):
        out = np.zeros((width, left.size))
        write(slice(0, left.size), out)
        raise CaughtError(weight, out)

    monkeypatch.setattr(module, "ordered_motion_sums", caught)
    with pytest.raises(CaughtError) as raised:
        steady.step(knots, spline, unknowns, np.ones(600, bool), 1)
    weight, out = raised.value.args

    def away(values: np.ndarray) -> np.ndarray:
        _, _, _, w, left = steady.state(knots, spline, values, slice(None))
        return left / w

    for k in range(unknowns.size):
        step = np.zeros(unknowns.size)
        step[k] = 1e-5
        slope = weight * (away(unknowns + step) - away(unknowns - step)) / 2e-5
        np.testing.assert_allclose(-slope, out[k], atol=1e-6)


def test_a_step_is_halved_until_no_angle_would_be_read_twice() -> None:
    steady, _ = work(1, False)
    start, step = np.zeros(8), np.zeros(8)
    step[2] = 1.0  # of order 3: a slope of 3
    found = steady.damped(start, step)
    assert found[2] == 0.25
    np.testing.assert_array_equal(steady.damped(start, 0.3 * step), 0.3 * step)


@pytest.mark.parametrize("sets", [1, 2])
def test_little_is_left_of_a_motion_without_error(sets: int) -> None:
    """The first spline is near to an even deceleration, but where it ends; turns are not."""
    steady, unknowns = work(sets, False)
    knots = steady.readings.knots(40)
    spline = steady.readings.first_spline(knots)
    left = steady.residuals(knots, spline, np.zeros_like(unknowns))
    assert left.shape == steady.readings.angle.shape
    assert 0.0 < np.abs(left[100:-100]).max() < 0.01
    moved = steady.residuals(knots, spline, unknowns) - left
    assert 1e-3 < np.abs(moved).max() < 0.1
