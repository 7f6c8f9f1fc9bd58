"""Lines and their sums against numpy, and what a filter and the joint's own error make of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.joint.joint import Joint
from trueangle.joint.pattern import (
    ARCSEC_PER_RAD,
    Harmonic,
    Pattern,
    line_columns,
    line_sum,
    lines_columns,
)

JOINT = Joint(50.0, "flexspline", "motor")
THETA = np.linspace(-7.0, 9.0, 301)


def some(seed: int, scale: float = 20.0) -> list[Harmonic]:
    rng = np.random.default_rng(seed)
    return [
        Harmonic(shaft, order, scale * rng.uniform(0.1, 1.0), rng.uniform(-180.0, 180.0))
        for shaft, order in (("output", 1), ("output", 2.5), ("motor", 1), ("wave_generator", 2))
    ]


def slow(lines: list[Harmonic], theta: np.ndarray) -> np.ndarray:
    total = np.zeros_like(theta)
    for line in lines:
        m = JOINT.shafts[line.shaft] * line.order
        total += line.amplitude_arcsec * np.sin(m * theta + math.radians(line.phase_deg))
    return total


def test_an_arcsec_is_a_part_of_a_turn() -> None:
    assert ARCSEC_PER_RAD * 2.0 * math.pi == pytest.approx(360.0 * 3600.0, rel=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_value_and_slope_are_those_of_the_sines(seed: int) -> None:
    lines = some(seed)
    pattern = Pattern.of(lines, JOINT)
    np.testing.assert_allclose(pattern.value(THETA), slow(lines, THETA), atol=1e-9)
    value, slope = pattern.value_and_slope(THETA.reshape(7, -1))
    assert value.shape == slope.shape == (7, 43)
    np.testing.assert_allclose(value.ravel(), slow(lines, THETA), atol=1e-9)
    step = 1e-6
    by_difference = (slow(lines, THETA + step) - slow(lines, THETA - step)) / (2.0 * step)
    np.testing.assert_allclose(slope.ravel(), by_difference / ARCSEC_PER_RAD, atol=1e-9)
    triples = tuple(
        (JOINT.shafts[h.shaft] * h.order, h.amplitude_arcsec, h.phase_deg) for h in lines
    )
    np.testing.assert_allclose(line_sum(THETA, triples), slow(lines, THETA), atol=1e-9)


def test_equal_output_orders_are_added_up() -> None:
    twice = [Harmonic("motor", 1, 3.0, 90.0), Harmonic("output", 50, 4.0, 0.0)]
    pattern = Pattern.of(twice, JOINT)
    assert pattern.orders.tolist() == [50.0]
    assert (pattern.cosine.tolist(), pattern.sine.tolist()) == ([3.0], [4.0])
    assert Harmonic("output", 1, 2.0, 180.0).coefficients == (0.0, -2.0)
    assert Harmonic("output", 1, 2.0, 30.0).coefficients == pytest.approx((1.0, math.sqrt(3.0)))
    # Rounded so that a right angle is one, and no farther.
    small = math.degrees(3e-12)
    assert Harmonic("output", 1, 1.0, small).coefficients[0] == pytest.approx(3e-12)
    for wrong in (0, -1, math.nan):
        with pytest.raises(ArgumentError, match="order must be positive"):
            Harmonic("output", wrong, 1.0)


def test_a_filter_that_only_delays_shows_the_pattern_of_before() -> None:
    lines = some(8)
    pattern = Pattern.of(lines, JOINT)
    speed = np.where(THETA > 0.0, 0.3, -0.2)
    tau = 0.004
    seen = pattern.passed(THETA, speed, lambda f: np.exp(-2j * np.pi * f * tau))
    np.testing.assert_allclose(seen, slow(lines, THETA - 2 * np.pi * speed * tau), atol=1e-9)
    same = pattern.passed(THETA, speed, lambda f: np.ones_like(f) + 0j)
    np.testing.assert_allclose(same, slow(lines, THETA), atol=1e-9)


@pytest.mark.parametrize("scale", [20.0, 3000.0, 5500.0, 6000.0])
def test_the_error_at_the_indicated_angle_solves_its_equation(scale: float) -> None:
    """From an encoder's size to slopes at which Newton's steps are no longer trusted."""
    lines = [Harmonic("output", 1, scale, 20.0), Harmonic("motor", 1, scale / 2.0, 70.0)]
    pattern = Pattern.of(lines, JOINT)
    steepest = 25.0 * scale / ARCSEC_PER_RAD + scale / ARCSEC_PER_RAD
    error = pattern.indicated_value(THETA, 400)
    left = np.abs(error - slow(lines, THETA + error / ARCSEC_PER_RAD)).max()
    assert left < 1e-8, steepest
    if scale <= 20.0:
        # Few steps are enough where the slope is that of a joint.
        np.testing.assert_allclose(pattern.indicated_value(THETA, 3), error, atol=1e-9)
        # The equation's own series: p + p p'.
        value, slope = pattern.value_and_slope(THETA)
        np.testing.assert_allclose(error, value * (1.0 + slope), atol=2e-4 * scale)


def test_columns_are_cosine_and_sine_and_what_vanishes_is_zero() -> None:
    orders = np.array([1.0, 18.0, 2.5])
    rng = np.random.default_rng(3)
    theta = rng.uniform(-9.0, 9.0, 50)
    columns = lines_columns(theta, orders)
    for j, m in enumerate(orders):
        np.testing.assert_allclose(columns[:, 2 * j], np.cos(m * theta), atol=1e-12)
        np.testing.assert_allclose(columns[:, 2 * j + 1], np.sin(m * theta), atol=1e-12)
        np.testing.assert_array_equal(line_columns(theta, m), columns[:, 2 * j : 2 * j + 2])
    grid = np.arange(36) * 2.0 * np.pi / 36.0
    on_grid = lines_columns(grid, orders)
    assert not on_grid[:, 3].any()
    assert np.abs(on_grid[:, [0, 1, 2, 4, 5]]).max(axis=0).min() > 0.9
    # A line that one reading alone shows is a regressor; one small everywhere is none.
    for size, vanishes in ((2e-10, False), (1.5e-10, True)):
        near = grid.copy()
        near[7] += size / 18.0
        assert (not lines_columns(near, orders)[:, 3].any()) == vanishes
    for size, vanishes in ((1.2e-11, False), (0.8e-11, True)):
        assert (not line_columns(np.array([0.0, size]), 0.5)[:, 1].any()) == (
            vanishes or size * 0.5 < 1e-11
        )
    assert lines_columns(np.zeros(0), orders).shape == (0, 6)
