"""A spin-down's numbers beside its orders: mirrored, in another unit, by parts, and its notes."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from selfcalibration.rotor import ARCSEC, coast, encoder
from trueangle.selfcalibration.result import OrderEstimate
from trueangle.selfcalibration.spindown import _may_be_ripple, _twice_integrated

SEED = 65_000
LINES = {1: (300.0, 0.3), 2: (150.0, 1.0), 4: (50.0, 2.0)}
OPTIONS = {"orders": [1, 2, 4], "loop": "open", "ripple": "none"}


def log_of(seed: int = SEED) -> dict[str, np.ndarray]:
    """Two seconds from 10 to 3 turns a second, 500 readings."""
    t, theta = coast(10.0, 3.0, 2.0)
    t, theta = t[::4], theta[::4]
    rng = np.random.default_rng(seed)
    reading = theta + encoder(theta, LINES) + 20.0 * ARCSEC * rng.normal(size=t.size)
    return {"time_s": t, "indicated_rad": np.mod(reading, 2.0 * np.pi)}


@pytest.fixture(scope="module")
def log() -> dict[str, np.ndarray]:
    print("seed", SEED)
    return log_of()


@pytest.fixture(scope="module")
def found(log: dict[str, np.ndarray]) -> ta.SelfCalibration:
    return ta.selfcal(log, **OPTIONS)


def numbers(value: object) -> list[float]:
    if isinstance(value, dict):
        return [n for key in sorted(value) for n in numbers(value[key])]
    if isinstance(value, list | tuple):
        return [n for one in value for n in numbers(one)]
    return [float(value)] if isinstance(value, int | float) else []


def test_it_tells_turns_readings_noise_and_limits(log, found) -> None:
    theta = np.unwrap(log["indicated_rad"])
    n = theta.size
    assert found.readings == n
    assert found.turns == pytest.approx(np.ptp(theta) / (2.0 * np.pi), rel=0.01)
    assert found.noise_arcsec == pytest.approx(20.0, rel=4.5 / math.sqrt(2.0 * n) + 0.01)
    for order in found.orders:
        size, phase = LINES[int(order.order)]
        assert abs(order.amplitude - size) < 4.5 * order.std
        away = (order.phase_deg - math.degrees(phase) + 180.0) % 360.0 - 180.0
        assert abs(away) < math.degrees(4.5 * order.std / size)
    # Of order 4 the motion takes next to nothing: the limit of white noise.
    last = found.orders[-1]
    assert last.std == pytest.approx(20.0 * math.sqrt(2.0 / n), rel=0.12)
    assert last.std_factor == pytest.approx(1.0, rel=0.06)
    assert last.retained == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("unit", ["deg", "turn"])
def test_every_unit_gives_the_same_numbers(log, found, unit: str) -> None:
    scale = {"deg": 360.0, "turn": 1.0}[unit] / (2.0 * np.pi)
    other = {"time_s": log["time_s"], f"indicated_{unit}": scale * log["indicated_rad"]}
    again = ta.selfcal(other, **OPTIONS)
    np.testing.assert_allclose(numbers(again.to_dict()), numbers(found.to_dict()), rtol=1e-6)
    assert again.notes == found.notes


def test_a_mirrored_shaft_has_mirrored_patterns(log, found) -> None:
    """Every number but the cosines' signs stays."""
    mirrored = {**log, "indicated_rad": np.mod(-log["indicated_rad"], 2.0 * np.pi)}
    other = ta.selfcal(mirrored, **OPTIONS)
    for a, b in zip(found.orders, other.orders, strict=True):
        assert b.cosine == pytest.approx(-a.cosine, abs=0.03 * a.std)
        assert b.sine == pytest.approx(a.sine, abs=0.03 * a.std)
        assert b.std == pytest.approx(a.std, rel=1e-3)
        assert b.retained == pytest.approx(a.retained, rel=1e-3)
    assert other.noise_arcsec == pytest.approx(found.noise_arcsec, rel=1e-4)
    for name, test in found.held_out.items():
        assert other.held_out[name].p == pytest.approx(test.p, abs=0.02)
        assert other.held_out[name].rms_after == pytest.approx(test.rms_after, rel=1e-3)


def test_parts_of_turns_predict_each_other_as_their_noise_says() -> None:
    """Of 16 coasts: p uniform; the error left is the noise and that of two patterns."""
    print("seeds", SEED + 100, "to", SEED + 115)
    ps: dict[str, list[float]] = {}
    for seed in range(SEED + 100, SEED + 116):
        result = ta.selfcal(log_of(seed), **OPTIONS)
        for name, test in result.held_out.items():
            ps.setdefault(name, []).append(test.p)
            rms = math.sqrt(400.0 + sum(c**2 for c, _ in LINES.values()) / 2.0)
            assert test.rms_before == pytest.approx(rms, rel=0.05)
            # Slow parts tell order 1 least.
            assert 18.0 < test.rms_after < (30.0 if name == "odd_even_turns" else 40.0)
    assert set(ps) == {"odd_even_turns", "speeds"}
    for name, values in ps.items():
        away = np.abs(np.sort(values) - (np.arange(len(values)) + 0.5) / len(values)).max()
        # Kolmogorov's distance: once in a thousand.
        assert away < 1.95 / math.sqrt(len(values)), name


def test_outliers_are_counted_and_a_changed_pattern_is_told(log) -> None:
    wild = {**log, "indicated_rad": log["indicated_rad"].copy()}
    wild["indicated_rad"][[50, 400, 411]] += np.array([0.02, -0.02, 0.05])
    notes = ta.selfcal(wild, **OPTIONS).notes
    assert any("3 outliers rejected" in note for note in notes)
    theta = np.unwrap(log["indicated_rad"])
    turn = np.floor((theta - theta[0]) / (2.0 * np.pi)).astype(int) & 1
    odd = {**log, "indicated_rad": np.mod(theta + 100.0 * ARCSEC * turn * np.sin(4.0 * theta),
                                          2.0 * np.pi)}  # fmt: skip
    told = ta.selfcal(odd, **OPTIONS)
    assert told.held_out["odd_even_turns"].p < 1e-6
    assert any("odd and even turns show different patterns" in note for note in told.notes)
    gap = math.sqrt(400.0 + 100.0**2 / 2.0)
    assert told.held_out["odd_even_turns"].rms_after == pytest.approx(gap, rel=0.1)


def test_a_current_moves_a_mass_by_its_second_integral() -> None:
    """Exact for a force that is linear between its readings, however these are spaced."""
    rng = np.random.default_rng(SEED)
    time = np.cumsum(rng.uniform(0.01, 0.05, 60))
    force = rng.normal(size=60)
    fine = np.unique(np.concatenate([np.linspace(time[0], time[-1], 200_001), time]))
    push = np.interp(fine, time, force - force.mean())
    speed = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (push[1:] + push[:-1]))])
    place = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
    exact = np.interp(time, fine, place)
    found = _twice_integrated(time, force)
    line = np.column_stack([np.ones(60), time])
    rest = [y - line @ np.linalg.lstsq(line, y, None)[0] for y in (found, exact)]
    np.testing.assert_allclose(rest[0], rest[1], atol=1e-7 * np.ptp(exact))


@pytest.mark.parametrize("order", [2.0, 3.0, 8.0])
def test_torque_ripple_falls_with_the_square_of_the_order(order: float) -> None:
    def one(k: float, size: float, std: float) -> OrderEstimate:
        return OrderEstimate(k, size, 0.0, std, 1.0, 1.0)

    first = one(1.0, 90.0, 1.0)
    for share, may in ((0.99, True), (1.01, False)):
        assert _may_be_ripple(one(order, share * 90.0 / order**2, 1.0), first) is may
        # Of a first order below its error twice this counts.
        faint = one(1.0, 1.0, 30.0)
        assert _may_be_ripple(one(order, share * 60.0 / order**2, 1.0), faint) is may
    assert _may_be_ripple(first, first)
    assert _may_be_ripple(one(order, 1e6, 1.0), None)


@pytest.mark.parametrize("slow", [5.0, 4.75])
def test_what_one_speed_cannot_tell_is_said_with_its_numbers(slow: float) -> None:
    """Orders 1 and 2 may be ripple; order 4 is more than order 1 over 16, and the encoder's."""
    lines = {1: (300.0, 0.3), 2: (60.0, 1.0), 4: (50.0, 2.0)}
    t, theta = coast(5.0, slow, 3.0)
    t, theta = t[::6], theta[::6]
    noise = 20.0 * ARCSEC * np.random.default_rng(SEED + 1).normal(size=t.size)
    log = {"time_s": t, "indicated_rad": np.mod(theta + encoder(theta, lines) + noise, 2.0 * np.pi)}
    told = ta.selfcal(log, orders=[1, 2, 4], loop="open")
    assert [o.order for o in told.sums] == [1.0, 2.0]
    assert [o.order for o in told.orders] == [4.0]
    (blind,) = [b for b in told.blind if b.orders == (1.0, 2.0)]
    ratio = float(blind.because.split("(ratio ")[1].split(")")[0])
    # Of the speeds from 5 to 95 % of the readings.
    assert ratio == pytest.approx((5.0 / slow) ** 0.9, abs=0.011)
    (note,) = [n for n in told.notes if n.startswith("one speed")]
    size = float(note.split("(")[1].split("/k^2")[0])
    assert size == pytest.approx(told.sums[0].amplitude, rel=0.005)
    assert told.model.period == 360.0
    alone = ta.selfcal(log, orders=[1, 2], loop="open")
    assert not alone.orders
    assert alone.summary().startswith("NO CORRECTION: no order is due to the encoder alone; ")
    assert not any(n.startswith("one speed") for n in alone.notes)


def test_louder_noise_beside_the_orders_widens_errors_by_its_root(
    log, found, monkeypatch: pytest.MonkeyPatch
) -> None:
    from trueangle.selfcalibration import spindown

    monkeypatch.setattr(spindown, "noise_spectrum_at", lambda *_: np.array([4.0, 1.0, 9.0]))
    louder = ta.selfcal(log, **OPTIONS)
    for o, p, times in zip(found.orders, louder.orders, (2.0, 1.0, 3.0), strict=True):
        assert p.std == pytest.approx(times * o.std, rel=1e-9)
        assert p.amplitude == pytest.approx(o.amplitude, rel=1e-12)
    assert any("9.0 times the white noise near order 4" in note for note in louder.notes)


def test_parts_are_held_against_the_noise_beside_their_orders(log, found, monkeypatch) -> None:
    """T^2 of two parts is less by as much as the noise is louder, that of each order by its own."""
    sizes = {}
    for loud in ((5.0, 5.0, 5.0), (5.0, 1.0, 1.0), (1.0, 5.0, 1.0), (1.0, 1.0, 5.0)):
        monkeypatch.setattr(
            "trueangle.selfcalibration.verification.noise_spectrum_at",
            lambda *_, colour=loud: np.array([colour, colour]),
        )
        wide = ta.selfcal(log, **OPTIONS).held_out
        assert wide.keys() == found.held_out.keys()
        sizes[loud] = {name: stats.chi2.isf(test.p, 6.0) for name, test in wide.items()}
    for name, test in found.held_out.items():
        plain = stats.chi2.isf(test.p, 6.0)
        every, *single = (one[name] for one in sizes.values())
        assert plain == pytest.approx(5.0 * every, rel=1e-6), name
        # Orders hardly correlate: each takes off four fifths of its own part.
        assert sum(plain - one for one in single) == pytest.approx(0.8 * plain, rel=0.1), name


def test_turns_and_readings_of_two_logs_add_up() -> None:
    print("seeds", SEED, SEED + 1)
    one, two = log_of(SEED), log_of(SEED + 1)
    both = {name: np.concatenate([one[name], two[name]]) for name in one}
    both["run"] = np.repeat([0, 1], one["time_s"].size)
    parts = [ta.selfcal(log, **OPTIONS) for log in (one, two)]
    whole = ta.selfcal(both, **OPTIONS)
    assert whole.turns == pytest.approx(sum(p.turns for p in parts), rel=1e-9)
    assert whole.readings == sum(p.readings for p in parts)


@pytest.mark.parametrize(("deviations", "outliers"), [(5.8, 0), (8.5, 1)])
def test_a_reading_is_an_outlier_beyond_seven_deviations(deviations: float, outliers: int) -> None:
    """The deviation by the median: of the noise, not of what half the readings stay within."""
    print("seed", SEED + 200)
    log = log_of(SEED + 200)
    theta = coast(10.0, 3.0, 2.0)[1][::4]
    off = deviations * 20.0 * ARCSEC
    log["indicated_rad"][250] = np.mod((theta + encoder(theta, LINES))[250] + off, 2.0 * np.pi)
    found = ta.selfcal(log, **OPTIONS)
    assert found.noise_arcsec == pytest.approx(20.0, rel=0.06)
    assert sum("outlier" in note for note in found.notes) == outliers


def test_an_order_is_kept_where_chance_makes_none_of_all_so_large() -> None:
    """By its distance in its own errors; none of 20 orders is there in 99 logs of 100."""
    print("seeds", SEED + 300, "to", SEED + 302)
    t, theta = coast(10.0, 3.0, 8.0)
    t, theta = t[::4], theta[::4]
    told = set()
    for seed in range(SEED + 300, SEED + 303):
        weak = 20.0 * math.sqrt(2.0 / t.size) * (4.6 if seed % 2 else 5.2)
        noise = 20.0 * ARCSEC * np.random.default_rng(seed).normal(size=t.size)
        reading = theta + encoder(theta, {**LINES, 6: (weak, 1.0)}) + noise
        log = {"time_s": t, "indicated_rad": np.mod(reading, 2.0 * np.pi)}
        all_of = ta.selfcal(log, **{**OPTIONS, "orders": range(1, 9)})
        (o,) = [o for o in all_of.orders if o.order == 6.0]
        # Read twice a wave at 250 readings a second and 5.5 turns.
        limit = stats.chi2.isf(0.01 / 20.0, 2)
        size = (o.amplitude / o.std) ** 2
        if abs(size / limit - 1.0) > 0.1:
            kept = {o.order for o in ta.selfcal(log, **{**OPTIONS, "orders": "auto"}).orders}
            assert (6.0 in kept) == (size > limit), (seed, size, limit)
            told.add(1.1 * limit < size < 1.9 * limit)
    assert True in told


@pytest.mark.parametrize("bandwidth", [0.5, 2.0, 3.0, 20.0])
def test_what_a_slow_loop_still_follows_widens_errors_and_is_told(log, found, bandwidth) -> None:
    """Of order k at s turns a second at most b/(ks), in any phase: half of it along each axis."""
    closed = ta.selfcal(log, **{**OPTIONS, "loop": "closed"}, loop_bandwidth=bandwidth)
    slowest = float(np.quantile(np.geomspace(3.0, 10.0, 1000), 0.02))
    given = [o for o in found.orders if o.order * slowest >= 2.0 * bandwidth]
    assert [o.order for o in closed.orders] == [o.order for o in given]
    for o, alone in zip(closed.orders, given, strict=True):
        followed = bandwidth / (o.order * slowest)
        std = math.hypot(alone.std, 0.5 * followed * alone.amplitude)
        assert o.std == pytest.approx(std, rel=0.03)
    told = [note for note in closed.notes if "rolls off slowly" in note]
    assert len(told) == bool(given)
    for note in told:
        share, order = re.findall(r"follows (\d+)% of order (\S+) ", note)[0]
        assert float(order) == given[0].order
        assert float(share) == pytest.approx(
            100.0 * bandwidth / (given[0].order * slowest), abs=1.0
        )
    assert not any("rolls off" in note for note in found.notes)
