"""Signals of a joint against a slow reading of their definitions."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.joint.earlier import earlier_signals
from trueangle.joint.signals import (
    Signals,
    _dead_zone_direction,
    direction_at_turns,
    join_runs,
    velocity_at_turns,
)

UNITS = (360.0, 2.0 * math.pi, 1.0, 4096.0)
SAMPLED = ("theta", "run", "row", "direction", "travel", "segment", "clock")
STRETCHES = ("segment_direction", "segment_length", "segment_first")
RECORDED = ("velocity", "time", "temperature", "torque", "mount", "current")


def sweep(seed: int, size: int = 60, period: float = 360.0, **more) -> CalibrationRun:
    """There and back twice at uneven speed, in any unit, with all that a run may record."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(3.0, 9.0, size) * np.where(np.arange(size) // 15 % 2, -1.0, 1.0)
    angle = np.cumsum(steps) / 360.0
    time = 5.0 + np.cumsum(rng.uniform(0.05, 0.15, size))
    values = {
        "time": time,
        "temperature": rng.normal(25.0, 1.0, size),
        "torque": rng.normal(0.0, 5.0, size),
        "mount": np.full(size, period / 12.0),
        "signals": {
            "current": rng.normal(size=size),
            "coupled_elbow": (np.mod(0.5 * angle, 1.0) * period),
        },
    }
    reference = np.mod(angle, 1.0) * period
    indicated = np.mod(angle + rng.normal(0.0, 1e-5, size), 1.0) * period
    return CalibrationRun(reference, indicated, period, **(values | more))


def assert_same(a: Signals, b: Signals, rtol: float = 1e-9) -> None:
    for name in (*SAMPLED, *STRETCHES, *RECORDED):
        left, right = getattr(a, name), getattr(b, name)
        assert (left is None) == (right is None), name
        if left is not None:
            np.testing.assert_allclose(left, right, rtol=rtol, atol=1e-9, err_msg=name)
    assert a.coupled.keys() == b.coupled.keys()
    for joint in a.coupled:
        np.testing.assert_allclose(a.coupled[joint], b.coupled[joint], rtol=rtol, atol=1e-9)


@pytest.mark.parametrize("period", UNITS[1:])
def test_every_unit_gives_the_same_signals(period: float) -> None:
    given = join_runs([sweep(k) for k in range(3)])
    assert_same(given, join_runs([sweep(k, period=period) for k in range(3)]))
    assert given.coupled.keys() == {"elbow"}
    assert given.velocity is not None
    assert given.mount == pytest.approx(2.0 * math.pi / 12.0)
    np.testing.assert_allclose(given.turns_per_s, given.velocity / 360.0)
    np.testing.assert_allclose(given.degrees, given.theta * 180.0 / math.pi)
    within = given.run[1:] == given.run[:-1]
    np.testing.assert_allclose(
        np.diff(given.coupled["elbow"])[within], 0.5 * np.diff(given.degrees)[within], atol=1e-9
    )


def test_travel_and_stretches_by_their_definition() -> None:
    run = sweep(4)
    found = join_runs([run])
    angle = np.degrees(np.unwrap(np.radians(run.reference)))
    origin, stretch, lengths = angle[0], 0, []
    for k in range(1, angle.size):
        if found.direction[k] != found.direction[k - 1]:
            d = found.direction[k - 1]
            # The turning point is the farther out of the readings beside it.
            far = max((angle[k - 1], angle[k]), key=lambda x, d=d: d * x)
            lengths.append(abs(far - origin))
            origin, stretch = far, stretch + 1
        assert found.segment[k] == stretch
        assert found.travel[k] == pytest.approx(abs(angle[k] - origin), abs=1e-9)
    lengths.append(abs(angle[-1] - origin))
    np.testing.assert_allclose(found.segment_length, lengths, atol=1e-9)
    assert found.segment_direction.tolist() == [1.0, -1.0, 1.0, -1.0]
    assert found.segment_first.tolist() == [True, False, False, False]
    assert found.travel[0] == 0.0


def test_runs_stand_one_after_the_other() -> None:
    runs = [sweep(0), sweep(1, 40), sweep(2, 50)]
    whole = join_runs(runs)
    assert (whole.runs, len(whole)) == (3, 150)
    assert whole.run_bounds() == [(0, 60), (60, 100), (100, 150)]
    assert whole.labels == ("1", "2", "3")
    np.testing.assert_array_equal(whole.row, [*range(60), *range(40), *range(50)])
    np.testing.assert_array_equal(whole.clock[[0, 60, 100]], 0.0)
    np.testing.assert_allclose(
        whole.run_turns(), [np.ptp(r.unwrapped_reference) / 360.0 for r in runs]
    )
    # One by one and put together is the same.
    one = join_runs(runs[:1])
    for run in runs[1:]:
        one = one.followed_by(join_runs([run]))
    assert_same(one, whole, 0.0)
    assert one.labels == ("1", "1", "1")
    # What one run lacks none has.
    lacking = join_runs([runs[0], sweep(1, torque=None, signals={})])
    assert lacking.torque is None
    assert lacking.current is None
    assert lacking.coupled == {}
    assert lacking.time is not None
    both = join_runs(runs[:1]).followed_by(join_runs([sweep(1, torque=None, signals={})]))
    assert_same(both, lacking, 0.0)
    assert join_runs([sweep(1, label="warm"), sweep(2)]).labels == ("warm", "2")


def test_rows_are_taken_with_all_that_they_recorded() -> None:
    whole = join_runs([sweep(0), sweep(1)])
    rows = np.flatnonzero(np.arange(len(whole)) % 7 == 3)
    for chosen in (rows, np.isin(np.arange(len(whole)), rows)):
        part = whole.take(chosen)
        for name in (*SAMPLED, *RECORDED):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])
        np.testing.assert_array_equal(part.coupled["elbow"], whole.coupled["elbow"][rows])
        assert part.segment_length is whole.segment_length
    assert whole.take(np.zeros(len(whole), bool)).run_bounds() == []
    assert join_runs([sweep(0, time=None)]).take(rows[:3]).time is None


def test_a_mirrored_joint_has_mirrored_signals() -> None:
    runs = [sweep(k, velocity=None) for k in range(2)]
    mirrored = [
        CalibrationRun(-r.reference, -r.indicated, 360.0, r.time, r.temperature) for r in runs
    ]
    a, b = join_runs(runs), join_runs(mirrored)
    assert a.velocity is not None
    assert b.velocity is not None
    np.testing.assert_array_equal(a.direction, -b.direction)
    np.testing.assert_allclose(a.velocity, -b.velocity, atol=1e-9)
    np.testing.assert_allclose(a.travel, b.travel, atol=1e-9)
    np.testing.assert_array_equal(a.segment, b.segment)
    np.testing.assert_allclose(a.segment_length, b.segment_length, atol=1e-9)
    for start in (0.0, 1.0, -0.5):
        np.testing.assert_allclose(a.presliding(7.0, start), -b.presliding(7.0, start), atol=1e-12)
        np.testing.assert_allclose(a.play(7.0, start), -b.play(7.0, start), atol=1e-12)


def loops(start: float, runs: int = 2) -> tuple[Signals, list[np.ndarray]]:
    """Signals without a jump at their turning points, and each run's angle in degrees."""
    turning = np.array([0.0, 20.0, 12.0, 30.0, 29.0, 33.0, -4.0])
    angle = np.concatenate(
        [np.linspace(a, b, 200, endpoint=False) for a, b in itertools.pairwise(turning)]
    )
    found = [angle + start, -0.4 * angle]
    return join_runs([CalibrationRun(a, a, 360.0) for a in found[:runs]]), found


@pytest.mark.parametrize("start", [0.0, 1.0, -0.7])
def test_presliding_is_the_spring_of_its_equation(start: float) -> None:
    """Slow: the state relaxes towards the direction, dz/ds = (d - z)/L, step by step."""
    signals, angles = loops(0.0)
    expected = []
    for angle in angles:
        steps = np.diff(angle)
        z = start * np.sign(steps[0])
        expected.append(z)
        for step in steps:
            d = np.sign(step)
            z = d - (d - z) * math.exp(-abs(step) / 3.0)
            expected.append(z)
    np.testing.assert_allclose(signals.presliding(3.0, start), expected, atol=0.002)
    # So short a length that the exponential would overflow leaves the direction.
    tiny = signals.presliding(1e-300, 0.0)
    np.testing.assert_array_equal(tiny[signals.travel > 0], signals.direction[signals.travel > 0])


@pytest.mark.parametrize("start", [1.0, 0.0, -0.7])
def test_play_is_a_peg_between_two_sides(start: float) -> None:
    signals, angles = loops(0.0)
    expected = []
    for angle in angles:
        z = start * np.sign(angle[1] - angle[0])
        expected.append(z)
        for step in np.diff(angle):
            z = float(np.clip(z + step / 2.5, -1.0, 1.0))
            expected.append(z)
    np.testing.assert_allclose(signals.play(2.5, start), expected, atol=1e-9)


def test_a_reference_that_flickers_is_read_with_a_dead_zone() -> None:
    """One step back in three, at the rate that a count does: still one way there and one back."""
    base = np.concatenate([np.arange(0.0, 300.0), np.arange(300.0, 0.0, -1.0)])
    angle = 0.1 * base
    angle[1::3] -= 0.15
    for sign in (1.0, -1.0):
        found = join_runs([CalibrationRun(sign * angle, sign * angle, 360.0)])
        turned = np.flatnonzero(np.diff(found.direction))
        assert turned.size == 1
        # Turned after the reading farthest out.
        assert turned[0] == np.argmax(angle)
        assert found.direction[0] == found.direction[1] == sign
        assert found.direction[-1] == -sign
    still = np.tile([0.0, 0.1], 100)
    assert not join_runs([CalibrationRun(still, still, 360.0)]).direction.any()


@pytest.mark.parametrize(("back", "turns"), [(2.9, 0), (3.1, 2)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_dead_zone_is_three_typical_steps(back: float, turns: int, sign: float) -> None:
    flicker = np.where(np.arange(60) % 2, -0.2, 0.2)
    steps = np.concatenate([np.full(200, 0.1), [-0.1 * back], np.full(200, 0.1), np.zeros(101)])
    angle = sign * (np.cumsum(np.concatenate([steps, flicker])))
    found = join_runs([CalibrationRun(angle, angle, 360.0)])
    assert np.count_nonzero(np.diff(found.direction)) == turns


@pytest.mark.parametrize(
    ("size", "reversals", "trusted"),
    [(60, 10, True), (60, 11, False), (220, 11, True), (219, 11, False), (400, 20, True)],
)
def test_so_many_reversals_are_trusted(size: int, reversals: int, trusted: bool) -> None:
    """Ten are taken as they are, of more one in twenty readings; else steps back are flicker."""
    edges = np.linspace(2, size - 2, reversals).astype(int)
    direction = np.where(np.searchsorted(edges, np.arange(size), side="right") % 2, -1.0, 1.0)
    angle = np.cumsum(direction * np.where(np.arange(size) % 7 == 3, 1.0, 0.01))
    found = join_runs([CalibrationRun(angle, angle, 360.0)])
    assert (np.count_nonzero(np.diff(found.direction)) == reversals) == trusted


def test_without_a_clock_the_places_are_the_clock() -> None:
    angle = np.array([0.0, 10.0, 25.0, 45.0])
    still = join_runs([CalibrationRun(np.zeros(4), np.zeros(4), 360.0)])
    assert not still.presliding(1.0, 1.0).any()
    assert not still.play(1.0, 1.0).any()
    for time in (None, np.full(4, 7.0)):
        found = join_runs([CalibrationRun(angle, angle, 360.0, time)])
        assert found.clock.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert found.velocity is None
        assert not found.turns_per_s.any()
    for clock, speed in (
        ([0.0, 1.0, 2.0, 3.0], [10.0, 12.5, 17.5, 20.0]),
        ([0.0, 0.0, 2.0, 3.0], None),
    ):
        timed = join_runs([CalibrationRun(angle, angle, 360.0, np.array(clock) + 3.0)])
        assert timed.clock.tolist() == clock
        assert speed is None or timed.velocity.tolist() == pytest.approx(speed)


def test_at_rest_the_direction_is_that_of_the_approach() -> None:
    angle = np.array([0.0, 10.0, 20.0, 20.0, 10.0, 0.0])
    found = join_runs([CalibrationRun(angle, angle, 360.0, velocity=np.zeros(6))])
    assert found.direction.tolist() == [1.0, 1.0, 1.0, 1.0, -1.0, -1.0]
    still = np.array([0.0, 0.0, -5.0, -5.0])
    found = join_runs([CalibrationRun(still, still, 360.0, velocity=np.zeros(4))])
    assert found.direction.tolist() == [-1.0, -1.0, -1.0, -1.0]


@pytest.mark.parametrize("period", UNITS)
def test_counts_are_told_in_arcsec(period: float) -> None:
    rng = np.random.default_rng(5)
    turns = np.sort(rng.uniform(0.0, 0.9, 200))
    rounded = np.round(turns * 4096.0) / 4096.0 * period
    found = join_runs([CalibrationRun(turns * period, rounded, period)])
    assert found.count == pytest.approx(1_296_000.0 / 4096.0, rel=1e-9)
    assert found.table == 0
    assert found.grid is None
    # A table of 72 positions, and one whose steps do not fill a turn.
    for move, table in ((1.0 / 72.0, 72), (1.0 / 72.4, 0)):
        angle = np.arange(60) * move * period
        found = join_runs([CalibrationRun(angle + 1e-3 * period, angle, period)])
        assert (found.count, found.table) == (0.0, table)


@pytest.mark.parametrize("seed", range(6))
def test_a_dead_zone_turns_at_the_reading_farthest_out_since_it_turned_last(seed: int) -> None:
    """Slow: the farthest of all readings since, looked for anew at each of them."""
    rng = np.random.default_rng([77, seed])
    angle = np.cumsum(rng.choice([-1.0, 1.0, 2.0, -4.0, 3.0], 400))
    zone = 3.0 * float(np.median(np.abs(np.diff(angle))))
    first = int(np.flatnonzero(np.abs(angle - angle[0]) > zone)[0])
    sign, start = float(np.sign(angle[first] - angle[0])), first
    expected = np.full(angle.size, sign)
    for k in range(first + 1, angle.size):
        part = sign * angle[start : k + 1]
        if part.max() - part[-1] > zone:
            farthest = start + int(np.flatnonzero(part == part.max())[-1])
            sign, start = -sign, k
            expected[farthest + 1 :] = sign
    assert np.count_nonzero(np.diff(expected)) > 5
    for way in (1.0, -1.0):
        np.testing.assert_array_equal(_dead_zone_direction(way * angle), way * expected)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("first", [7.0, 40.0])
def test_a_dead_zone_turns_at_the_first_reading_beyond_it_where_that_is_the_farthest(
    first: float, sign: float
) -> None:
    angle = sign * np.concatenate([[0.0], first - 2.0 * np.arange(30.0)])
    wanted = sign * np.concatenate([[1.0, 1.0], np.full(29, -1.0)])
    np.testing.assert_array_equal(_dead_zone_direction(angle), wanted)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("peak", "turns"), [(2, 0), (3, 0), (4, 1)])
def test_the_first_direction_is_that_of_the_first_reading_beyond_the_dead_zone(
    peak: int, turns: int, sign: float
) -> None:
    """In counts of one, of which three are within it; what went before has that direction too."""
    angle = sign * np.concatenate([np.arange(peak + 1.0), np.arange(peak - 1.0, -30.0, -1.0)])
    found = _dead_zone_direction(angle)
    expected = np.full(angle.size, -sign)
    if turns:
        expected[: peak + 1] = sign
    np.testing.assert_array_equal(found, expected)


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


def test_a_velocity_of_rounding_is_rest_and_keeps_the_direction() -> None:
    """A moving mean of zeros is rounding, of another sign on another processor."""
    theta = np.concatenate([np.arange(50.0), np.full(40, 49.0), np.arange(48.0, 0.0, -1.0)])
    velocity = np.diff(theta, prepend=-1.0)
    rounded = velocity + np.where(velocity == 0.0, 1e-13 * (-1.0) ** np.arange(theta.size), 0.0)
    still, noisy = (
        CalibrationRun(theta, theta, 360.0, time=np.arange(theta.size) / 10.0, velocity=v)
        for v in (velocity, rounded)
    )
    assert np.array_equal(noisy.direction, still.direction)
    assert np.array_equal(np.flatnonzero(np.diff(still.direction)), [89])


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
