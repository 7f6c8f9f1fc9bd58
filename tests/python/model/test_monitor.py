"""A watched joint: silence where nothing changes, alarms where something does, in little memory."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.support.runlength import chart_limit, run_length

SEED = 53_001

#: Readings of a turn.
PER = 120


def model(orders=2):
    sizes = [0.01 / k for k in range(1, orders + 1)]
    shaft = ta.Shaft("output", 1, range(1, orders + 1), sizes, sizes[::-1])
    return ta.HarmonicModel([shaft], period=360.0)


def noise(kind, rng, count):
    white = rng.normal(size=count)
    if kind == "white":
        return white
    if kind == "ar":
        return lfilter([1.0], [1.0, -0.9], white)
    frequency = np.fft.rfftfreq(count)
    frequency[0] = frequency[1]
    return np.fft.irfft(np.fft.rfft(white) / np.sqrt(frequency), count)


def readings(rng, turns, kind="white", orders=2):
    angle = np.arange(PER * turns) * (360.0 / PER)
    return angle, model(orders).error(angle) + 0.001 * noise(kind, rng, angle.size)


def test_run_lengths_are_the_published_ones():
    """Montgomery's table, and the exact figures of Page's integral equation."""
    for shift, length in ((0.0, 465.44), (0.5, 38.0), (1.0, 10.38)):
        assert run_length(0.5, 5.0, shift) == pytest.approx(length, rel=1e-3)
    for shift, length in ((0.0, 168.0), (0.5, 26.6), (1.0, 8.38)):
        assert run_length(0.5, 4.0, shift) == pytest.approx(length, rel=3e-3)
    assert chart_limit(0.5, 4 * 465.44) == pytest.approx(6.37, abs=0.01)
    with pytest.raises(ArgumentError, match="limit must be positive"):
        run_length(0.5, 0.0)


@pytest.mark.parametrize(("shift", "length"), [(0.0, 465.0), (0.5, 38.0), (1.0, 10.4)])
def test_a_chart_of_known_noise_runs_as_long(shift, length):
    """Tabular sums in plain numpy against the equation that the limit comes from."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    runs = np.zeros(2000)
    upper, lower = np.zeros(2000), np.zeros(2000)
    going = np.ones(2000, dtype=bool)
    while going.any():
        value = rng.normal(shift, 1.0, 2000)
        upper, lower = np.maximum(upper + value - 0.5, 0), np.maximum(lower - value - 0.5, 0)
        runs += going
        going &= np.maximum(upper, lower) <= 5.0
    assert runs.mean() == pytest.approx(length, rel=0.05)


@pytest.mark.parametrize("kind", ["white", "ar", "1/f"])
def test_all_charts_together_are_silent_for_as_long_as_they_say(kind):
    print("seed", SEED)
    windows = alarms = 0
    for i in range(12):
        rng = np.random.default_rng(SEED + i)
        watched = ta.Monitor(model())
        alarms += len(watched.update(*readings(rng, 2000, kind)))
        windows += watched.windows
    print(windows, alarms)
    # 465 windows or more to one, and two standard deviations of the count.
    wanted = windows / 465.0
    assert alarms <= wanted + 2.0 * np.sqrt(wanted)


def test_a_change_is_told_with_its_order_its_size_and_its_time():
    print("seed", SEED)
    delays = []
    for i in range(20):
        rng = np.random.default_rng(SEED + 100 + i)
        angle, error = readings(rng, 260)
        sigma = 0.001 * np.sqrt(2.0 / PER)
        after = PER * 200
        error[after:] += 2.0 * sigma * np.sin(2.0 * np.radians(angle[after:]))
        found = [a for a in ta.Monitor(model()).update(angle, error) if a.window > 200]
        assert found
        delays.append(found[0].window - 200)
        assert "order 2 moved" in found[0].because
        assert "arcsec (+- " in found[0].because
        assert found[0].statistic > found[0].limit
    print(delays)
    assert np.mean(delays) < 8.0


@pytest.mark.parametrize(("sigmas", "held"), [(2.0, 0.85), (30.0, 0.9)])
def test_the_size_that_is_told_holds_the_truth(sigmas, held):
    """Of two standard errors 95 %; of shifts that are small the larger ones alarm first."""
    print("seed", SEED)
    inside, sizes = 0, []
    unit = 3600.0 * 0.001 * np.sqrt(2.0 / PER)
    for i in range(60):
        rng = np.random.default_rng(SEED + 300 + i)
        angle, error = readings(rng, 130)
        after, phase = PER * 100, rng.uniform(0.0, 2.0 * np.pi)
        wave = np.sin(2.0 * np.radians(angle[after:]) + phase)
        error[after:] += sigmas * unit / 3600.0 * wave
        first = next(a for a in ta.Monitor(model()).update(angle, error) if a.window > 100)
        size, std = re.search(r"moved by (\S+) arcsec \(\+- (\S+) arcsec", first.because).groups()
        inside += abs(float(size) - sigmas * unit) <= 2.0 * float(std)
        sizes.append(float(size) / (sigmas * unit))
    print("held", inside / 60, "mean", np.mean(sizes))
    assert inside >= held * 60
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.25)


def test_a_jump_of_the_zero_is_told():
    rng = np.random.default_rng(SEED + 200)
    angle, error = readings(rng, 100)
    error[PER * 50 :] += 0.002
    found = ta.Monitor(model()).update(angle, error, time=angle / 36.0)
    assert [a.window for a in found] == [51]
    assert "the zero moved" in found[0].because
    assert found[0].time == pytest.approx(510.0, abs=10.0)


def test_a_joint_that_is_not_the_models_from_the_start_is_told():
    rng = np.random.default_rng(SEED + 201)
    angle, error = readings(rng, 12)
    found = ta.Monitor(model()).update(angle, error + 0.002 * np.cos(np.radians(angle)))
    assert found[0].window == 8
    assert "order 1 differs from the model by" in found[0].because


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("half", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_growing_coefficient_raises_its_upper_sum_and_no_other(order, half, sign):
    """Cosine before sine; below its lines the sum that is called lower."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 203)
    angle, error = readings(rng, 100)
    wave = (np.cos, np.sin)[half](order * np.radians(angle[PER * 90 :]))
    error[PER * 90 :] += sign * 0.0003 * wave
    watched = ta.Monitor(model(), run_length=1e9)

    def sums():
        return {
            (rows["order"], k, name): rows[name][k]
            for rows in watched.state["orders"]
            for k in (0, 1)
            for name in ("upper", "lower")
        }

    assert watched.update(angle[: PER * 90], error[: PER * 90]) == []
    before = sums()
    watched.windows_of(angle[PER * 90 : PER * 93], error[PER * 90 : PER * 93])
    after = sums()
    # Of three windows at 2.3 standard deviations, each less half of one: 5.4 and noise of 1.7.
    grown = {which: value - before[which] for which, value in after.items()}
    most = max(grown, key=grown.__getitem__)
    assert most == (order, half, "upper" if sign > 0 else "lower")
    assert grown[most] == pytest.approx(5.4, abs=4.0)


def test_it_does_not_depend_on_how_readings_arrive():
    rng = np.random.default_rng(SEED + 202)
    angle, error = readings(rng, 40)
    whole, single = ta.Monitor(model()), ta.Monitor(model())
    windows = whole.windows_of(angle, error)
    parts = [w for i in range(angle.size) for w in single.windows_of(angle[i], error[i])]
    assert [w.orders for w in parts] == [w.orders for w in windows]
    assert whole.state == single.state
    # Angles within a turn, and errors that lie a turn off, are the same joint.
    other = ta.Monitor(model()).windows_of(angle % 360.0, error + 360.0)
    assert [w.orders[0].amplitude for w in other] == pytest.approx(
        [w.orders[0].amplitude for w in windows], rel=1e-6, abs=1e-9
    )


def test_its_state_is_small_and_stays_so():
    watched = ta.Monitor(model(32))
    size = watched.nbytes
    assert size < 64_000
    watched.update(*readings(np.random.default_rng(SEED), 50, orders=32))
    assert watched.nbytes == size
    assert watched.state["windows"] == watched.windows == 49


def test_what_is_not_finite_is_left_out():
    rng = np.random.default_rng(SEED + 203)
    angle, error = readings(rng, 20)
    error[::7] = np.nan
    assert not ta.Monitor(model()).update(angle, error)


def test_an_arc_waits_for_the_rest_of_the_turn():
    angle = 40.0 * np.sin(np.arange(20_000) * 0.01)
    watched = ta.Monitor(model())
    assert not watched.update(angle, model().error(angle))
    assert watched.windows == 0


def test_what_cannot_be_watched_is_refused():
    for name, value in (("every", 0.0), ("shift", -1.0), ("run_length", 1.0)):
        with pytest.raises(ArgumentError, match=f"{name} must be"):
            ta.Monitor(model(), **{name: value})
    with pytest.raises(ArgumentError, match="no orders to watch"):
        ta.Monitor(ta.HarmonicModel([], period=360.0))
    motor = ta.HarmonicModel([ta.Shaft("motor", 7.3, [1], [0.1], [0.0])], period=360.0)
    with pytest.raises(ArgumentError, match="not periodic in one output turn"):
        ta.Monitor(motor)
    high = ta.HarmonicModel([ta.Shaft("output", 1, [5000], [1e-6], [0.0])], period=360.0)
    with pytest.raises(ArgumentError, match="above 4096"):
        ta.Monitor(high)
    with pytest.raises(ArgumentError, match="error has 2 values"):
        ta.Monitor(model()).update([1.0, 2.0, 3.0], [1.0, 2.0])


@pytest.mark.parametrize("step", [3.0, 0.36, 1.234567])
@pytest.mark.parametrize("count", [1, 8, 32])
def test_what_windows_lack_of_a_model_is_no_change(count, step):
    """Without noise nothing but the sums' own rounding is left, and that is the same every turn."""
    orders = list(range(1, count + 1))
    shaft = ta.Shaft("output", 1, orders, [0.01] * count, [0.02] * count)
    exact = ta.HarmonicModel([shaft], period=360.0)
    angle = np.arange(0.0, 40 * 360.0, step)
    assert not ta.Monitor(exact).update(angle, exact.error(angle))
