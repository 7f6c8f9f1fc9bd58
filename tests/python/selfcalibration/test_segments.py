"""Stretches cut from logs: bounds from both sides, speeds, and what is said of logs that fail."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.errors import FileError, NoModelError
from trueangle.selfcalibration.orderchoice import highest_order
from trueangle.selfcalibration.recording import Recording
from trueangle.selfcalibration.segments import Segment, SegmentReadings, cut_stretches, ripple_lead
from trueangle.selfcalibration.verification import _turn_numbers

TURN = 2.0 * math.pi


def log(angle: np.ndarray, rate: float = 100.0, **more) -> Recording:
    time = more.pop("time", 3.0 + np.arange(angle.size) / rate)
    return Recording(more.pop("label", None), time, np.mod(angle, TURN), **more)


def segment(time: np.ndarray, angle: np.ndarray) -> Segment:
    return Segment(time, angle, log(angle, time=time), slice(0, time.size))


def test_a_log_of_both_directions_has_two_stretches() -> None:
    there = np.linspace(0.0, 5.0 * TURN, 2000)
    angle = np.concatenate([there, there[::-1]])
    for sign in (1.0, -1.0):
        found = cut_stretches([log(sign * angle)])
        assert [s.direction for s in found] == [sign, -sign]
        for s in found:
            assert s.turns == pytest.approx(5.0, abs=0.1)
            assert s.speed == pytest.approx(5.0 / 20.0, rel=0.01)
            np.testing.assert_array_equal(s.time, s.recording.time[s.rows])
            np.testing.assert_allclose(np.mod(s.angle - s.recording.indicated[s.rows] + 1, TURN), 1)
        assert found[0].rows.start == 0
        assert found[1].rows.stop == 4000
        assert found[1].rows.start - found[0].rows.stop < 30


def test_turns_and_readings_that_are_needed() -> None:
    for turns, enough in ((2.0, True), (1.97, False)):
        one = log(np.linspace(0.0, turns * TURN, 400))
        if enough:
            assert len(cut_stretches([one])) == 1
        else:
            with pytest.raises(NoModelError, match="2 turns of steady motion"):
                cut_stretches([one])
    # Each of three runs shows too little to be a stretch, or is one.
    for turns, enough in ((0.85, True), (0.75, False)):
        some = [log(np.linspace(0.0, turns * TURN, 100)) for _ in range(3)]
        if enough:
            assert len(cut_stretches(some)) == 3
        else:
            with pytest.raises(NoModelError, match="no turn of steady motion"):
                cut_stretches(some)
    for size, enough in ((100, True), (99, False)):
        some = [log(np.linspace(0.0, 3.0 * TURN, size)) for _ in range(2)]
        if enough:
            assert len(cut_stretches(some)) == 2
        else:
            with pytest.raises(NoModelError, match="only 198 readings in motion"):
                cut_stretches(some)
    with pytest.raises(NoModelError, match=r"1 turn of steady"):
        cut_stretches([log(np.linspace(0.0, TURN, 300))])
    for size, stretches in ((47, 1), (48, 2)):
        some = [log(np.linspace(0.0, 3.0 * TURN, 300)), log(np.linspace(0.0, TURN, size))]
        assert len(cut_stretches(some)) == stretches


@pytest.mark.parametrize("turns", [[0.8, 3.0], [1.2, 2.0, 1.0], [2.6, 0.9, 4.4]])
def test_turns_are_counted_on_from_stretch_to_stretch(turns) -> None:
    """Every stretch has its whole turns, one at least, and no number is left out."""
    stretches = [
        segment(np.linspace(0.0, 9.0, 500), np.linspace(0.3, 0.3 + TURN * n, 500)) for n in turns
    ]
    number = _turn_numbers(SegmentReadings(stretches))
    whole = [max(1, round(n)) for n in turns]
    assert sorted(set(number.tolist())) == list(range(sum(whole)))
    assert [len(set(part)) for part in np.split(number, len(turns))] == whole


def test_readings_of_one_time_stamp_do_not_move() -> None:
    """A recorder that begins with what its buffer held stamps all of that alike."""
    angle = np.linspace(0.0, 5.0 * TURN, 240)
    time = np.arange(240) / 100.0
    time[:12] = time[11]
    (found,) = cut_stretches([log(angle, time=time)])
    assert (found.rows.start, found.rows.stop) == (12, 240)


def test_slow_motion_and_pauses_are_left_out() -> None:
    fast = np.linspace(0.0, 10.0 * TURN, 4000)
    for share, kept in ((0.25, True), (0.15, False)):
        step = share * 10.0 * TURN / 4000
        angle = np.concatenate([fast, fast[-1] + step * np.arange(1, 2401)])
        (found,) = cut_stretches([log(angle)])
        assert (found.rows.stop > 6000) == kept
    time = np.arange(4000) / 100.0
    for gap, pieces in ((0.17, 1), (0.21, 2)):
        late = time + gap * (np.arange(4000) >= 1500)
        found = cut_stretches([log(fast, time=late)])
        assert len(found) == pieces
        assert pieces == 1 or found[1].rows.start == 1500


@pytest.mark.parametrize("file", ["a.csv", ""])
def test_logs_that_fail_are_named(file: str) -> None:
    angle = np.linspace(0.0, 5.0 * TURN, 600)
    kind = FileError if file else NoModelError
    back = np.arange(600) / 100.0
    back[300] = 2.5
    cases = (
        (Recording("7", None, angle, file=file), "no column time_s"),
        (Recording("7", back, None, file=file), "no column indicated_deg"),
        (Recording("7", back, angle, file=file), "time runs backwards at 2.5 s"),
        (Recording("7", np.ones(600), angle, file=file), "all time stamps are equal"),
    )
    for recording, says in cases:
        with pytest.raises(kind, match=f"run 7: .*{says}"):
            cut_stretches([recording])
    for step, fails in ((0.24, False), (0.26, True)):
        fast = log(TURN * step * np.arange(600), label="7", file=file)
        if fails:
            with pytest.raises(kind, match=r"0.4 turn between readings at 100 Hz .* least 400 t"):
                cut_stretches([fast])
        else:
            assert cut_stretches([fast])[0].turns == pytest.approx(0.24 * 599, rel=0.02)


def test_an_angle_counted_over_turns_starts_in_its_first() -> None:
    angle = 40.0 * TURN + 1.0 + np.linspace(0.0, 5.0 * TURN, 900)
    recording = Recording(None, np.arange(900) / 100.0, angle)
    (found,) = cut_stretches([recording])
    np.testing.assert_allclose(found.angle, angle - 40.0 * TURN, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_speed_over_a_turn_holds_no_error_of_the_encoder(sign: float) -> None:
    time = np.linspace(0.0, 10.0, 4000)
    true = TURN * 20.0 * (1.0 - np.exp(-0.1 * time))
    speed = 2.0 * np.exp(-0.1 * time)
    found = segment(time, sign * (true + 0.02 * np.sin(true))).turn_speed()
    np.testing.assert_allclose(found, speed, rtol=0.01)
    # Beyond the middle of the first and the last turn as it changes there, not elsewhere.
    even = segment(time, sign * TURN * (2.0 * time - 0.05 * time**2)).turn_speed()
    np.testing.assert_allclose(even, 2.0 - 0.1 * time, rtol=3e-3)
    short = segment(time, sign * np.linspace(0.0, 1.2 * TURN, 4000))
    np.testing.assert_allclose(short.turn_speed(), 0.12)
    # Up to a turn and a quarter the mean, however the speed changes; beyond it, not.
    for turns, even in ((0.9, True), (1.24, True), (1.26, False)):
        found = segment(time, sign * TURN * turns * (time / 10.0) ** 2).turn_speed()
        assert (np.ptp(found) == 0.0) == even
        assert not even or found[0] == pytest.approx(turns / 10.0)


def test_the_lead_of_ripple_is_that_of_its_friction() -> None:
    """Viscous friction c: (c w + 3 c w) / w^2 = 4 c / w; at constant deceleration a: 3 a / w^2."""
    time = np.linspace(0.0, 10.0, 4000)
    speed = 2.0 * np.exp(-0.1 * time)
    stretch = segment(time, TURN * 20.0 * (1.0 - np.exp(-0.1 * time)))
    np.testing.assert_allclose(ripple_lead(stretch, speed), 0.4 / (TURN * speed), rtol=0.02)
    back = segment(time, -TURN * 20.0 * (1.0 - np.exp(-0.1 * time)))
    np.testing.assert_allclose(ripple_lead(back, speed), -0.4 / (TURN * speed), rtol=0.02)
    even = 2.0 - 0.1 * time
    stretch = segment(time, TURN * (2.0 * time - 0.05 * time**2))
    expected = 3.0 * 0.1 * TURN / (TURN * even) ** 2
    # Its logarithm is a polynomial to a tenth.
    np.testing.assert_allclose(ripple_lead(stretch, even), expected, rtol=0.12)
    for turns, known in ((5.9, False), (6.1, True)):
        few = segment(time, turns * TURN * (1.0 - np.exp(-0.1 * time)) / (1.0 - math.exp(-1.0)))
        assert ripple_lead(few, few.turn_speed()).any() == known


def test_readings_of_all_stretches_in_one_list() -> None:
    time = np.linspace(0.0, 10.0, 1000)
    one = segment(time, TURN * 2.3 * time)
    other = segment(time[:400] + 50.0, -TURN * 2.0 * time[:400])
    found = SegmentReadings([one, other])
    assert (found.size, found.trends) == (1400, (4, 1))
    np.testing.assert_array_equal(found.stretch, [0] * 1000 + [1] * 400)
    np.testing.assert_array_equal(found.time, np.concatenate([one.time, other.time]))
    mean = math.exp((1000 * math.log(2.3) + 400 * math.log(2.0)) / 1400)
    assert found.mean_speed == pytest.approx(mean, rel=1e-6)
    np.testing.assert_allclose(found.ripple[[0, -1]], [(mean / 2.3) ** 2, (mean / 2.0) ** 2],
                               rtol=1e-6)  # fmt: skip
    # Turns: 23 and 8; of a part at the end the last whole one.
    number = _turn_numbers(found)
    assert (number[0], number[999], number[1000], number[-1]) == (0, 22, 23, 30)
    assert (np.diff(number) >= 0).all()
    assert np.bincount(number[:1000]).min() > 40
    # 0.45 waves a reading: at 2.3 turns a second and 100 Hz to order 19.
    assert highest_order(found) == int(0.45 / (2.3 * 10.0 / 999))
    slow = SegmentReadings([segment(time, TURN * 0.21 * time)])
    assert highest_order(slow) == 128
    for intervals in (4, 64, 512):
        knots = found.knots(intervals)
        spans = (10.0, 10.0 * 399 / 999)
        for start, n, s, span in zip(knots.start, knots.intervals, found.stretches, spans,
                                     strict=True):  # fmt: skip
            assert n * knots.spacing >= span
            # The stretch stands in the middle of its knots, wherever it began.
            middle = 0.5 * (s.time[0] + s.time[-1])
            assert start + 0.5 * n * knots.spacing == pytest.approx(middle, abs=1e-6)
        assert sum(knots.intervals) <= 2.5 * max(intervals, 8)
        if intervals < 512:
            continue
        assert sum(knots.intervals) >= 0.4 * min(1400 // 6, intervals)
        unit = math.gcd(*knots.intervals)
        assert unit >= 8
        assert unit & (unit - 1) == 0
        spline = found.first_spline(knots)
        # A straight motion is its own spline, beyond the ends too.
        rate = np.repeat([TURN * 2.3, -TURN * 2.0], np.array(knots.intervals) + 3)
        begin = np.repeat([0.0, 50.0], np.array(knots.intervals) + 3)
        np.testing.assert_allclose(spline, rate * (knots.greville() - begin), atol=1e-6)


def test_angles_in_which_a_turn_is_lost_have_no_speed() -> None:
    time = np.arange(360.0)
    with pytest.raises(NoModelError, match="where a turn takes no time; check their unit"):
        segment(time, time * 1e300).turn_speed()
