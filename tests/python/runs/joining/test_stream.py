"""Streams of a log and the error along a travel: interpolation, gaps, changes, seams."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.runs.joining.clocks import Clocks, _as_quartzes, _inflation, estimated_clocks
from trueangle.runs.joining.simulated import TravelledError
from trueangle.runs.joining.stream import Stream


def curve(time: np.ndarray) -> np.ndarray:
    return 20.0 * time + 60.0 * np.sin(0.7 * time) + 40.0 * np.sin(0.31 * time)


def slope(time: np.ndarray) -> np.ndarray:
    return 20.0 + 42.0 * np.cos(0.7 * time) + 12.4 * np.cos(0.31 * time)


def sampled(seed: int = 1, n: int = 400) -> Stream:
    time = 2.0 + np.cumsum(np.random.default_rng(seed).uniform(0.02, 0.06, n))
    return Stream(time, curve(time))


def test_rows_are_sorted_unwrapped_and_equal_times_averaged() -> None:
    found = Stream.of(np.array([3.0, 1.0, 2.0, 2.0]), np.array([20.0, 350.0, 10.0, 5.0]))
    assert found.time.tolist() == [1.0, 2.0, 3.0]
    assert found.angle.tolist() == [350.0, 367.5, 380.0]
    assert found.step == 1.0
    assert Stream(np.zeros(1), np.zeros(1)).step == 0.0


def test_lines_and_cubics_between_readings() -> None:
    found = sampled()
    time = np.random.default_rng(2).uniform(found.time[2], found.time[-3], 500)
    lines, speeds = found.at(time, cubic=False)
    np.testing.assert_allclose(lines, np.interp(time, found.time, found.angle), atol=1e-10)
    k = np.searchsorted(found.time, time) - 1
    np.testing.assert_allclose(speeds, np.diff(found.angle)[k] / np.diff(found.time)[k])
    cubics, velocity = found.at(time, cubic=True)
    np.testing.assert_allclose(cubics, curve(time), atol=2e-4)
    np.testing.assert_allclose(velocity, slope(time), atol=0.05)
    # The velocity is the derivative of what is said of the angle.
    h = 1e-6
    inside = np.abs(found.time[:, None] - time).min(axis=0) > 2 * h
    ahead, behind = found.at(time + h, True)[0], found.at(time - h, True)[0]
    np.testing.assert_allclose(((ahead - behind) / (2 * h))[inside], velocity[inside], atol=1e-5)
    np.testing.assert_allclose(found.at(found.time, True)[0], found.angle, atol=1e-10)
    few = Stream(np.arange(3.0), np.array([0.0, 1.0, 4.0]))
    assert few.at(np.array([1.5]), True)[0].tolist() == [2.5]
    parabola = Stream(np.arange(9.0), np.arange(9.0) ** 2)
    value, rate = parabola.at(np.array([3.25, 4.0]), True)
    np.testing.assert_allclose(value, [3.25**2, 16.0])
    np.testing.assert_allclose(rate, [6.5, 8.0])


def test_what_interpolation_adds_is_told_in_its_size() -> None:
    found = sampled()
    assert found.is_cubic
    between = 0.5 * (found.time[5:-5] + found.time[4:-6])
    spread = np.std(found.at(between)[0] - curve(between))
    assert 0.2 * spread < found.interpolation_std < 5.0 * spread
    noisy = Stream(found.time, found.angle + np.random.default_rng(3).normal(0.0, 3.0, 400))
    assert not noisy.is_cubic
    # White noise: a left-out reading differs by (1 + 1/2)^(1/2) of it; told is a quarter.
    assert noisy.interpolation_std == pytest.approx(3.0 * 1.5**0.5 / 4.0, rel=0.2)
    assert Stream(np.arange(5.0), np.arange(5.0)).interpolation_std == 0.0


@pytest.mark.parametrize("step", [0.1, 0.05])
def test_what_a_cubic_adds_grows_with_the_fourth_power_of_the_step(step: float) -> None:
    """Told from readings left out at twice the distance, against the truth in the middle."""
    time = np.arange(0.0, 60.0, step)
    found = Stream(time, curve(time))
    middle = time[8:-8] + 0.5 * step
    off = np.abs(found.at(middle)[0] - curve(middle))
    assert found.is_cubic
    assert found.interpolation_std == pytest.approx(1.4826 * np.median(off), rel=0.03)


def test_gaps_from_both_sides() -> None:
    for pause, gap in ((4.9, False), (5.1, True)):
        time = np.concatenate([np.arange(50.0), 49.0 + pause + np.arange(50.0)])
        found = Stream(time, 3.0 * time)
        assert found.gaps(None).tolist() == ([[49.0, 49.0 + pause]] if gap else [])
        inside = found.covers(np.array([48.5, 49.0, 50.0, 49.0 + pause, 60.0]))
        assert inside.tolist() == [True, True, not gap, True, True]
        assert found.gaps(4.0).tolist() == [[49.0, 49.0 + pause]]
        assert found.gaps(6.0).tolist() == []
    ends = found.covers(np.array([-0.0009, -0.0011, time[-1] + 0.0009, time[-1] + 0.0011]))
    assert ends.tolist() == [True, False, True, False]


@pytest.mark.parametrize("each", [1, 2, 3, 5])
def test_bursts_of_stamps_in_milliseconds_leave_no_gaps(each: int) -> None:
    """Of bursts of three 2907 of 3060 readings had been discarded: the median step was 1 ms."""
    time = np.sort(np.add.outer(np.arange(0.0, 120.0, 0.02), 0.0008 * np.arange(each)).ravel())
    stream = Stream.of(np.floor(1000.0 * time) / 1000.0, np.round(2.0 * slope(time)) / 2.0)
    assert stream.covers(np.linspace(1.0, 119.0, 500)).mean() > 0.99


def test_a_log_on_change_stood_still_in_its_pauses() -> None:
    time = np.concatenate([np.arange(20.0), 40.0 + np.arange(20.0)])
    angle = np.arange(40.0)
    found = Stream(time, angle)
    assert found.is_on_change
    assert found.gaps(None).shape == (0, 2)
    assert found.gaps(10.0).tolist() == [[19.0, 40.0]]
    assert (found.held.time.size, found.held.angle[20], found.held.time[20]) == (41, 19.0, 39.0)
    assert found.at(np.array([30.0, 39.5]))[0].tolist() == [19.0, 19.5]
    # Moved on meanwhile, or repeats, or no pause, or too few: sampled.
    moved = Stream(time, angle + np.where(time >= 40.0, 5.0, 0.0))
    repeats = Stream(time, np.where(np.arange(40) == 7, 6.0, angle))
    even = Stream(np.arange(40.0), angle)
    few = Stream(time[16:23], angle[16:23])
    for other in (moved, repeats, even, few):
        assert not other.is_on_change
        assert other.held is other
    for pause, kept in ((2.9, False), (3.1, True)):
        late = np.concatenate([np.arange(20.0), 19.0 + pause + np.arange(20.0)])
        assert Stream(late, angle).is_on_change == kept
    for step, kept in ((2.0, True), (2.1, False)):
        stepped = Stream(time, angle + np.where(time >= 40.0, step - 1.0, 0.0))
        assert stepped.is_on_change == kept


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_clocks_have_their_offset_rate_and_errors(sign: float) -> None:
    """Pulls over seeds: mean 0, deviation 1; the other sign as well."""
    pulls = []
    for seed in range(15):
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, 60.0, 0.05)
        rate, offset = sign * 400.0, sign * 1.7
        there = time + offset + 1e-6 * rate * time
        true = np.arange(-10.0, 75.0, 0.04)
        reference = Stream(true, curve(true))
        said = Stream(time, curve(there) + rng.normal(0.0, 0.02, time.size) + 3.0)
        found = estimated_clocks(said, reference, None, None)
        assert found.offset_std is not None
        assert found.rate_std is not None
        pulls.append(
            [(found.offset - offset) / found.offset_std, (found.rate - rate) / found.rate_std]
        )
    assert np.abs(np.mean(pulls, axis=0)).max() < 0.7
    assert 0.7 < np.std(pulls) < 1.3
    np.testing.assert_allclose(found.to_other(time), there, atol=0.01)
    only = estimated_clocks(said, reference, None, rate)
    assert only.rate == rate
    assert only.rate_std is None
    assert abs(only.offset - offset) < 5.0 * only.offset_std
    assert only.timing_std == pytest.approx(only.offset_std, rel=1e-6)
    declared = estimated_clocks(said, reference, offset, rate)
    assert declared == Clocks(0.0, offset, rate)
    assert any("constant delay" in note for note in found.notes)


def test_clocks_run_from_the_first_reading() -> None:
    clocks = Clocks(10.0, 2.0, 1000.0)
    assert clocks.to_other(np.array([10.0, 1010.0])).tolist() == [12.0, 1013.0]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_neighbours_that_are_alike_inflate_a_variance(memory: float) -> None:
    e = np.random.default_rng(4).normal(size=40_000)
    for k in range(1, e.size):
        e[k] += memory * e[k - 1]
    assert _inflation(e) == pytest.approx((1.0 + memory) / (1.0 - memory), rel=0.06)
    assert _inflation(np.zeros(5)) == 1.0
    assert _inflation(np.ones(5000)) == pytest.approx(199.0)
    assert _inflation(np.tile([1.0, -1.0], 50)) == 1.0


def travelled(low: float, high: float, back: bool = True) -> TravelledError:
    angle = np.arange(low, high)
    way = np.ones(angle.size)
    if back:
        angle, way = np.concatenate([angle, angle[::-1]]), np.concatenate([way, -way])
    error = np.sin(np.radians(angle)) + 0.2 * way
    return TravelledError(angle, error, way)


def test_the_error_of_each_direction_where_the_log_says_one() -> None:
    log = travelled(10.0, 200.0)
    assert log.has_both
    assert not travelled(10.0, 200.0, back=False).has_both
    assert log.step == 1.0
    assert log.std == pytest.approx(0.0, abs=1e-12)
    asked = np.array([9.1, 8.9, 50.5, 200.1, 199.9])
    for way in (1.0, -1.0):
        error, known = log.at(asked, np.full(5, way))
        np.testing.assert_allclose(error[2], np.sin(np.radians(50.5)) + 0.2 * way, atol=1e-4)
        assert known.tolist() == [True, False, True, False, True]
    # A turn on, and one back: the angles of the log.
    for turn in (360.0, -720.0):
        error, known = log.at(asked[2:3] + turn, np.ones(1))
        assert known.all()
        np.testing.assert_allclose(error, np.sin(np.radians(50.5)) + 0.2, atol=1e-4)
    one = travelled(10.0, 200.0, back=False).at(asked[2:3], -np.ones(1))[0]
    np.testing.assert_allclose(one, np.sin(np.radians(50.5)) + 0.2, atol=1e-4)


def test_a_whole_turn_closes_over_its_seam() -> None:
    asked = np.array([355.0, 359.5, 364.5, 725.0])
    # Up to 2 % of a turn may be missing; over five steps nothing is said.
    for missing, expected in (
        (4, [True, True, True, True]),
        (7, [False, False, True, True]),
        (8, [False, False, True, True]),
        (9, [False, True, True, False]),
    ):
        error, known = travelled(0.0, 360.0 - missing).at(asked, np.ones(4))
        assert known.tolist() == expected
        if missing == 4:
            np.testing.assert_allclose(error, np.sin(np.radians(asked)) + 0.2, atol=0.01)
    for gap, known in ((4.9, True), (5.9, False)):
        angle = np.concatenate([np.arange(0.0, 100.0), 99.0 + gap + np.arange(0.0, 100.0)])
        log = TravelledError(angle, np.zeros(200), np.ones(200))
        assert log.at(np.array([101.0]), np.ones(1))[1][0] == known
    scattered = TravelledError(
        np.repeat(np.arange(50.0), 2), np.tile([1.0, -1.0], 50), np.ones(100)
    )
    assert scattered.std == pytest.approx(1.0)


def test_a_rate_that_is_hardly_known_is_one_of_quartzes() -> None:
    """By the densities themselves, on a grid of rates."""
    found = Clocks(0.0, 1.0, 3.1, 0.2, 2.0, 0.0, -0.3)
    time = np.linspace(0.0, 60.0, 40)
    shown = _as_quartzes(found, time)
    rates = np.linspace(-800.0, 800.0, 160_001)
    weights = np.exp(-0.5 * (rates / 100.0) ** 2) * np.exp(-0.5 * ((rates - 3.1) / 2.0) ** 2)
    weights /= weights.sum()
    # Of a rate that is known the offset is 1 - 0.3 / 4 (3.1 - rate), and its error less.
    offsets = 1.0 + 0.3 / 4.0 * (3.1 - rates)
    left = 0.2**2 - 0.3**2 / 4.0
    rate, offset = weights @ rates, weights @ offsets
    assert shown.rate == pytest.approx(rate, rel=1e-3)
    assert shown.offset == pytest.approx(offset, rel=1e-4)
    assert shown.rate_std == pytest.approx(np.sqrt(weights @ (rates - rate) ** 2), rel=1e-3)
    variance = left + weights @ (offsets - offset) ** 2
    assert shown.offset_std == pytest.approx(np.sqrt(variance), rel=1e-3)
    there = offsets[:, None] - offset + 1e-6 * (rates - rate)[:, None] * time
    timing = left + (weights @ there**2).mean()
    assert shown.timing_std == pytest.approx(np.sqrt(timing), rel=1e-3)


@pytest.mark.parametrize("rate", [0.0, 20.0, 80.0])
def test_offsets_hold_where_the_rate_is_hardly_known(rate: float) -> None:
    """Noise of 0.3 degrees, rates to 40 ppm; of clocks taken as equal to 6.5."""
    print("seeds 8600 to 8619")
    pulls = []
    for seed in range(8600, 8620):
        rng = np.random.default_rng(seed)
        time = np.sort(rng.uniform(0.0, 30.0, 600))
        true = np.arange(-1.0, 31.0, 0.01)
        said = Stream(time, curve(time) + rng.normal(0.0, 0.3, time.size))
        there = true + 1.7 + 1e-6 * rate * (true - time[0])
        found = estimated_clocks(said, Stream(there, curve(true)), None, None)
        assert found.offset_std is not None
        assert found.rate_std is not None
        pulls.append((found.offset - 1.7) / found.offset_std)
    rms = float(np.sqrt(np.mean(np.square(pulls))))
    print(rms)
    assert 0.55 < rms < 1.5  # of twenty to 16 %


def test_a_rate_is_taken_as_it_is_from_five_standard_errors_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for share, taken in ((4.9, False), (5.1, True)):

        def solved(indicated, reference, clocks, wanted, share=share):
            return Clocks(0.0, 1.0, -2.0 * share, 0.1, 2.0)

        monkeypatch.setattr("trueangle.runs.joining.clocks._solved", solved)
        found = estimated_clocks(sampled(), sampled(), 0.0, None)
        assert (found.rate == -2.0 * share) == taken
        assert found.rate == pytest.approx(-2.0 * share, rel=0.01)


@pytest.mark.parametrize("apart", [0.0, 3001.3, -252.1])
@pytest.mark.parametrize("behind", [0.0, 1.7])
def test_offsets_that_fit_as_well_are_those_of_the_motions_period(apart, behind) -> None:
    """A motion of 5 s, clocks that begin far apart: every one told is a whole period from it."""
    period = 5.0
    time = np.arange(0.0, 60.0, 0.02)

    def motion(t: np.ndarray) -> np.ndarray:
        turn = 2.0 * np.pi * t / period
        return 30.0 * np.sin(turn) + 8.0 * np.cos(2.0 * turn)

    said = Stream(time, motion(time))
    true = Stream(time + apart, motion(time - behind))
    found = estimated_clocks(said, true, None, 0.0)
    (note,) = [text for text in found.notes if "repeats itself" in text]
    told = [float(word) for word in note.split("offsets of ")[1].split(" s fit")[0].split(", ")]
    assert len(told) == 4
    for other in (*told, found.offset):
        periods = (other - apart - behind) / period
        assert abs(periods - round(periods)) < 0.01, other
    assert len({round((other - found.offset) / period) for other in (*told, found.offset)}) == 5
    # The one taken has most readings in common.
    assert abs(found.offset - apart) <= min(abs(other - apart) for other in told) + 1e-6


@pytest.mark.parametrize(
    ("declared", "rate"),
    [
        *(((), rate) for rate in (-300.0, 1000.0)),
        *((("offset",), rate) for rate in (-5000.0, 300.0, 1000.0)),
        *((("rate",), rate) for rate in (-5000.0, 300.0, 1000.0)),
    ],
)
def test_clocks_are_found_whatever_of_them_is_declared(
    declared: tuple[str, ...], rate: float
) -> None:
    own, other = np.arange(0.0, 300.0, 0.05), np.arange(-5.0, 310.0, 0.02)
    known = {"offset": 1.7, "rate": rate}
    offset, given = (known[name] if name in declared else None for name in known)
    there = own + 1.7 + 1e-6 * rate * own
    # An error that no motion of a clock makes.
    said = Stream.of(own, curve(there) + 1e-3 * np.sin(1e3 * own**2))
    found = estimated_clocks(said, Stream.of(other, curve(other)), offset, given)
    np.testing.assert_allclose(found.to_other(own), there, rtol=0.0, atol=1e-5)
    assert [std is None for std in (found.offset_std, found.rate_std)] == [
        name in declared for name in known
    ]
    for name, std in (("offset", found.offset_std), ("rate", found.rate_std)):
        assert abs(getattr(found, name) - known[name]) <= 5.0 * (std or 0.0), name
