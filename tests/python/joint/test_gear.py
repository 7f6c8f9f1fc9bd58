"""Orders that a gear is known to make, against what its teeth and turns say by themselves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.errors import ArgumentError
from trueangle.joint.gear import (
    COMMON_RATIOS,
    explain_as_harmonic,
    explain_by_shafts,
    explain_order,
    gear_orders,
    wanted_orders,
)
from trueangle.joint.shafts import (
    MOST_ORDERS,
    Shaft,
    limited_orders,
    resolve_orders,
    shaft_cycles,
)
from trueangle.joint.signals import join_runs
from trueangle.joint.turning import direction_at_turns, velocity_at_turns


@pytest.mark.parametrize("ratio", [0.5, 30.0, 50.5, 100.0, 161.0])
@pytest.mark.parametrize(("member", "sign"), [("circular_spline", 1), ("flexspline", -1)])
def test_a_strain_wave_gear_has_its_seven_orders(ratio: float, member: str, sign: int) -> None:
    found = gear_orders(ratio, member)
    generator = ratio + sign
    own, other = ("flexspline", "circular spline")[::sign]
    expected = {
        ratio: ("once per motor turn",),
        generator: (f"against the {own}", "once per turn"),
        2 * ratio: ("twice per motor turn", f"mesh with the {own}"),
        ratio + generator: ("side band",),
        2 * generator: (f"tooth mesh with the {other}",),
        3 * ratio: ("three times per motor turn",),
        4 * ratio: ("four times per motor turn", "interpolation"),
    }
    assert list(found) == list(expected)
    for order, phrases in expected.items():
        assert all(phrase in found[order] for phrase in phrases)
        assert isinstance(next(k for k in found if k == order), int) == float(order).is_integer()


def test_any_other_gear_has_four_multiples_and_no_gear_none() -> None:
    assert gear_orders(7.0, "none") == {
        7: "once per motor turn",
        14: "twice per motor turn",
        21: "three times per motor turn",
        28: "four times per motor turn",
    }
    assert gear_orders(1.0, "none") == {}
    assert list(gear_orders(0.5, "none")) == [0.5, 1, 1.5, 2]
    # A whole order that rounding has moved a little is whole.
    assert list(gear_orders(50.0 + 1e-12)) == [50, 51, 100, 101, 102, 150, 200]


@pytest.mark.parametrize("ratio", [0.0, -math.inf, math.inf, math.nan])
def test_a_ratio_must_be_finite_and_not_0(ratio: float) -> None:
    with pytest.raises(ArgumentError, match=r"gear_ratio must be motor turns .*, finite and not 0"):
        gear_orders(ratio)


def test_what_is_wanted_by_default() -> None:
    low = tuple(range(1, 18))
    assert wanted_orders(None) == low
    assert wanted_orders(100) == (*low, 100, 101, 200, 201, 202, 300, 400)
    assert wanted_orders(100, "flexspline", 2) == (1, 2, 99, 100, 198, 199, 200, 300, 400)
    assert wanted_orders(2.5, "none", 3) == (1, 2, 2.5, 3, 5, 7.5, 10)


def test_lines_of_the_output_side() -> None:
    begins = {1: "eccentricity", 2: "sensor displaced", 3: "second harmonic", 4: "interpolation"}
    for order in range(8):
        found = explain_order(order, gear_ratio=100.0)
        assert [e.order for e in found] == ([order] if order in begins else [])
        for one in found:
            assert one.name.startswith(begins[order])
            assert (one.gear_ratio, one.assumed) == (None, False)
    # An alias is no reason to think of the output side.
    assert explain_order(35, [1], gear_ratio=100.0) == ()


def test_without_a_ratio_the_common_ones_are_tried() -> None:
    assert COMMON_RATIOS == (30, 50, 80, 100, 120, 160)
    found = explain_order(7, [100.0])
    assert [(e.order, e.gear_ratio, e.assumed) for e in found] == [
        (100, 50, True),
        (100, 100, True),
    ]
    assert str(found[1]).endswith("wave generator, if the gear ratio is 100)")
    known = explain_order(100.0, gear_ratio=50, fixed_member="none")
    assert [str(e) for e in known] == ["100 (twice per motor turn)"]
    assert not known[0].assumed


def test_a_harmonic_belongs_to_a_line_three_times_as_large() -> None:
    def bases(order: float, amplitudes: dict[float, float]) -> list[str]:
        return [e.name.split(",")[0] for e in explain_as_harmonic(order, amplitudes)]

    assert bases(12, {4: 6.0, 12: 2.0}) == ["harmonic 3 of order 4"]
    assert bases(12, {4: 5.99, 12: 2.0}) == []
    # The largest of those it is a multiple of.
    assert bases(12, {4: 6.0, 6: 8.0, 3: 7.0, 12: 2.0}) == ["harmonic 2 of order 6"]
    assert bases(12, {1: 99.0, 12: 2.0}) == []
    assert bases(12, {5: 99.0, 12: 2.0}) == []
    assert bases(16, {2: 99.0, 16: 2.0}) == ["harmonic 8 of order 2"]
    assert bases(18, {2: 99.0, 18: 2.0}) == []
    assert bases(7.5, {2.5: 99.0, 7.5: 2.0}) == ["harmonic 3 of order 2.5"]
    assert bases(12, {12: 99.0}) == []
    assert bases(12, {4: 80.0}) == []
    assert explain_as_harmonic(12, {4: 6.0, 12: 2.0})[0].order == 12


def test_a_declared_shaft_has_four_multiples() -> None:
    times = {1: "once", 2: "twice", 3: "three times", 4: "four times"}
    for k in range(7):
        found = explain_by_shafts(14.4 * k, {"belt": 0.37, "worm": 14.4})
        expected = [f"{times[k]} per turn of the worm"] if k in times else []
        assert [e.name for e in found] == expected
    assert explain_by_shafts(14.4 * 1.001, {"worm": 14.4}) == ()


@pytest.mark.parametrize("ratio", [0.25, 1.5, 50.0, 100.7])
def test_the_wave_generator_turns_against_the_output_member(ratio: float) -> None:
    plain = {"output": 1.0, "motor": ratio}
    assert shaft_cycles(ratio, "none") == plain
    assert shaft_cycles(ratio) == plain | {"wave_generator": ratio + 1.0}
    if ratio > 1.0:
        assert shaft_cycles(ratio, "flexspline") == plain | {"wave_generator": ratio - 1.0}
    assert shaft_cycles(None) == {"output": 1.0}


@pytest.mark.parametrize("ratio", [0.0, -math.inf, math.inf, math.nan])
def test_no_such_ratio(ratio: float) -> None:
    with pytest.raises(ArgumentError, match="motor turns per output turn, finite and not 0"):
        shaft_cycles(ratio)


def test_a_generator_that_stands_is_refused() -> None:
    with pytest.raises(ArgumentError, match="above 1 where the flexspline is fixed"):
        shaft_cycles(1.0, "flexspline")
    assert shaft_cycles(1.0 + 1e-9, "flexspline")["wave_generator"] > 0.0
    with pytest.raises(ArgumentError, match="fixed_member must be one of"):
        shaft_cycles(None, "flexpline")


def test_a_shaft_is_the_sines_that_it_says() -> None:
    shaft = Shaft("motor", 100, [1, 2, 3], [3, 0, -1], [4, 2, 0])  # type: ignore[arg-type]
    x = np.linspace(0.0, 7.0, 50)
    for k, a, b, c, phi in zip(
        shaft.orders, shaft.cosine, shaft.sine, shaft.amplitudes, shaft.phases, strict=True
    ):
        np.testing.assert_allclose(
            a * np.cos(k * x) + b * np.sin(k * x), c * np.sin(k * x + phi), atol=1e-12
        )
        assert c > 0.0
    assert [type(v) for v in (shaft.cycles_per_turn, shaft.orders[0], shaft.cosine[0])] == [
        float,
        int,
        float,
    ]


def test_so_many_orders_and_not_one_more() -> None:
    assert MOST_ORDERS == 4096
    assert limited_orders(range(MOST_ORDERS)) == list(range(MOST_ORDERS))
    with pytest.raises(ArgumentError, match="lines are too many: 4096 at a time"):
        limited_orders(range(MOST_ORDERS + 1), "lines")
    # What never ends is refused too.
    with pytest.raises(ArgumentError, match="too many"):
        limited_orders(itertools.count())


def test_orders_are_sorted_and_told_once() -> None:
    found = resolve_orders({"motor": [4, 2.0, np.int64(2), 1], "output": [3], "belt": []}, 50.0,
                           shafts={"belt": 0.37})  # fmt: skip
    assert found == [("motor", 50.0, (1, 2, 4)), ("output", 1.0, (3,))]
    assert all(type(k) is int for k in found[0].orders)
    assert resolve_orders(range(1, 4)) == [("output", 1.0, (1, 2, 3))]
    assert resolve_orders({"belt": [2]}, shafts={"belt": 0.37}) == [("belt", 0.37, (2,))]
    assert resolve_orders({"wave_generator": [1]}, 50.0, "flexspline")[0].cycles_per_turn == 49.0
    assert resolve_orders({}) == []


@pytest.mark.parametrize("kind", [int, float, np.int64])
def test_whole_numbers_from_one_to_the_largest(kind: type) -> None:
    for whole in (1, 2**31 - 1):
        assert resolve_orders([kind(whole)])[0].orders == (whole,)
    for wrong in (0, 2**31, -1):
        with pytest.raises(ArgumentError, match="orders of shaft 'output' must be whole numbers"):
            resolve_orders([kind(wrong)])


@pytest.mark.parametrize("wrong", [1.5, math.nan, math.inf, "two", None, True + 0.25])
def test_what_is_no_order(wrong: object) -> None:
    with pytest.raises(ArgumentError, match="must be whole numbers from 1, got"):
        resolve_orders({"output": [1, wrong]})  # type: ignore[list-item]


def test_what_is_no_list_and_what_turns_unknown() -> None:
    with pytest.raises(ArgumentError, match=r"shaft 'output' must be a list .* got 3"):
        resolve_orders(3)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="how fast shaft 'motor' turns is not known"):
        resolve_orders({"motor": [1]})
    with pytest.raises(ArgumentError, match="orders of shaft 'motor' are too many"):
        resolve_orders({"motor": range(1, MOST_ORDERS + 2)}, 50.0)


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
