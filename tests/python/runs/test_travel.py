"""Travels: what is slow taken out, turns put on, orders that a short pass holds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.runs.travel import (
    Span,
    covered_span,
    held_orders,
    over_turns,
    travelled_span,
    without_drift,
)

UNITS = (360.0, 2.0 * math.pi, 1.0, 4096.0)


def short(travel: float, size: int = 500, period: float = 360.0, error=None, seed: int = 1):
    theta = np.linspace(0.0, travel * period, size)
    noise = np.random.default_rng(seed).normal(0.0, 1e-5 * period, size)
    shown = noise if error is None else noise + error(theta / period) * period
    return CalibrationRun(theta, theta + shown, period=period)


@pytest.mark.parametrize("period", UNITS)
def test_a_short_pass_holds_lines_that_come_back(period: float) -> None:
    for travel, held in ((0.249, True), (0.251, False)):
        found = held_orders([short(travel, period=period)], [360.0])
        assert found == (pytest.approx(2.0 / travel) if held else 0.0)
    # The declared line must come back twice, or neighbours agree.
    travel = 0.1
    assert held_orders([short(travel, period=period)], [20.1]) == pytest.approx(20.0)
    assert held_orders([short(travel, period=period)], [19.9]) == 0.0
    assert held_orders([short(travel, period=period)], []) == 0.0
    wave = short(travel, period=period, error=lambda x: 1e-3 * np.sin(600.0 * x))
    assert held_orders([wave], []) == pytest.approx(20.0)
    turned = short(travel, period=period, error=lambda x: 1e-3 * (-1.0) ** np.arange(x.size))
    assert held_orders([turned], []) == 0.0
    # What is slow in it is none of the noise, nor are four harmonics of a declared line.
    drift = short(travel, period=period, error=lambda x: 1e-3 * (x / 0.1) ** 3)
    assert held_orders([drift], []) == 0.0
    for harmonic in (1, 4, 5):
        line = short(
            travel, period=period,
            error=lambda x, k=harmonic: 1e-3 * np.sin(2 * np.pi * 40.0 * k * x + 1.0),
        )  # fmt: skip
        assert held_orders([line], [40.0]) == pytest.approx(20.0)
    assert held_orders([wave, wave], [360.0]) == 0.0
    for size, told in ((100, True), (99, False)):
        assert (held_orders([short(travel, size, period)], [360.0]) > 0.0) == told
    for share, told in ((0.24, True), (0.26, False)):
        back = np.concatenate(
            [np.linspace(0.0, 36.0, 400), np.linspace(36.0, 36.0 * (1 - 2 * share), 400)]
        )
        run = CalibrationRun(back, back, 360.0)
        assert (held_orders([run], [360.0]) > 0.0) == told


@pytest.mark.parametrize("period", UNITS)
def test_what_is_slow_is_taken_out_beside_the_lines(period: float) -> None:
    theta = np.linspace(0.3, 0.36, 400) * period
    line = 1e-4 * period * np.cos(2.0 * np.pi * 90.5 * theta / period + 0.4)
    x = 2.0 * (theta - theta.mean()) / np.ptp(theta)
    slow = 1e-3 * period * (x - 2.0 * x**3 + x**5)
    run = CalibrationRun(theta, theta + line + slow + 0.01 * period, period)
    left = without_drift(run, [90.5]).centred_error
    np.testing.assert_allclose(left, line + 0.01 * period, atol=1e-9 * period)
    # An even part has its mean about the middle of the travel in any unit.
    even = CalibrationRun(theta, theta + 1e-3 * period * (3.0 * x**2 - 1.0), period)
    np.testing.assert_allclose(without_drift(even, [90.5]).centred_error, 0.0, atol=1e-9 * period)
    # Of degree six a part stays.
    more = CalibrationRun(theta, theta + line + 1e-3 * period * x**6, period)
    rest = without_drift(more, [90.5]).centred_error - line
    assert np.ptp(rest) > 1e-5 * period


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turns_are_put_on_where_they_can_be_told(period: float, sign: float) -> None:
    theta = sign * np.linspace(0.2, 2.6, 40) * period
    error = 0.001 * period * np.sin(np.arange(40.0))
    run = CalibrationRun(np.mod(theta, period), np.mod(theta + error, period), period)
    found = over_turns(run)
    np.testing.assert_allclose(np.diff(found.reference), np.diff(theta), atol=1e-9 * period)
    np.testing.assert_allclose(found.indicated - found.reference, error, atol=1e-9 * period)
    given = CalibrationRun(theta, theta, period)
    assert over_turns(given) is given
    still = CalibrationRun(np.mod(theta[:8], period), np.mod(theta[:8], period), period)
    assert over_turns(still) is still
    # Up to one step in ten may jump over the border.
    for jumps, told in ((4, True), (5, False)):
        at = np.linspace(4, 36, jumps).astype(int)
        side = np.searchsorted(at, np.arange(40), side="right") % 2
        angle = np.where(side == 1, 0.9, 0.1) * period
        moved = CalibrationRun(angle, angle, period)
        assert (over_turns(moved) is not moved) == told


def test_spans_in_words_and_over_the_turns() -> None:
    assert Span(200.0, 500.0, False).describe(360.0) == "-160 to 140 deg"
    assert Span(20.0, 300.0, False).describe(360.0) == "20 to 300 deg"
    assert Span(0.0, 420.0, False).describe(360.0) == "0 to 420 deg"
    assert Span(0.0, 360.0, True).describe(360.0) == "0 to 360 deg"
    assert Span(180.0, 360.0, False).describe(360.0) == "180 to 360 deg"
    assert Span(20.0, 380.0, False).describe(360.0) == "20 to 380 deg"
    assert Span(0.02, 280.0, False).describe(360.0) == "0 to 280 deg"
    assert Span(0.03, 280.0, False).describe(360.0) == "0.03 to 280 deg"
    two = [np.linspace(30.0, 90.0, 40), np.linspace(-400.0, -300.0, 40)]
    assert travelled_span(two, 360.0, False) == Span(-400.0, 90.0, False)
    found = travelled_span(two, 360.0, True)
    assert found == covered_span(two, 360.0)
    assert (found.start, found.stop) == (pytest.approx(320.0), pytest.approx(450.0))
    whole = covered_span([np.linspace(0.0, 360.0, 96)], 360.0)
    assert whole == Span(0.0, 360.0, True)


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_of_half_a_turn_is_no_jump_over_the_border(period: float, sign: float) -> None:
    """Of ten readings one step may be a jump: beside one no other counts."""
    turns = np.array([0.1, 0.3, 0.5, 0.0, 0.5, 0.7, 0.9, 0.1, 0.3, 0.5])
    angle = sign * np.where(turns == 0.0, 0.0, turns) * period
    run = CalibrationRun(angle, angle, period)
    steps = np.diff(over_turns(run).reference)
    expected = sign * np.array([0.2, 0.2, -0.5, 0.5, 0.2, 0.2, 0.2, 0.2, 0.2]) * period
    np.testing.assert_allclose(steps, expected, atol=1e-9 * period)
    twice = sign * np.array([0.9, 0.1, 0.3, 0.5, 0.7, 0.9, 0.1, 0.2, 0.3, 0.4]) * period
    given = CalibrationRun(twice, twice, period)
    assert over_turns(given) is given
    halves = sign * np.array([0.0, 0.5, 0.0, 0.5]) * period
    given = CalibrationRun(halves, halves, period)
    assert over_turns(given) is given


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_run_with_turns_has_the_error_that_it_had(period: float, sign: float) -> None:
    """The indicated angle goes along, its zero with it, and all that was recorded stays."""
    theta = sign * np.linspace(0.2, 1.7, 50)
    time = np.arange(50.0)
    run = CalibrationRun(
        np.mod(theta, 1.0) * period, np.mod(theta + 0.3, 1.0) * period, period, time=time
    )
    found = over_turns(run)
    np.testing.assert_allclose(np.diff(found.reference), np.diff(theta) * period, atol=1e-9)
    np.testing.assert_allclose(found.indicated - found.reference, 0.3 * period, atol=1e-9 * period)
    np.testing.assert_array_equal(found.time, time)
    assert found.reference[0] == run.reference[0]
    assert found.period == period
