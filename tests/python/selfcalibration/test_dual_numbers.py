"""Numbers beside the patterns of two encoders: delay, reversal, ratio, what predicts what."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal, stats

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.selfcalibration.gearlines import gear_motion, near_reversal

SEED = 68_000
SEEDS = range(SEED, SEED + 10)
RATIO, DELAY, PLAY, NOISE, ZERO = 30.37, 2e-4, 12.0, 3.0, 1.1

#: Of 10 pulls: 4.5 errors of their mean.
CENTRED = 4.5 / math.sqrt(10.0)


def there_and_back(seed: int, size: int = 700) -> dict[str, np.ndarray]:
    """A swing over a turn and a bit, both ways; the output lags and plays."""
    rng = np.random.default_rng(seed)
    # It begins and ends at full speed: at the ends of a run the nearest speed known is taken.
    phase = 2.0 * np.pi * (np.arange(size) / size + 0.25)
    theta = 0.3 + 3.3 * (1.0 - np.cos(phase))
    speed, way = 2.5 * np.sin(phase), np.sign(np.sin(phase))
    place = theta + ZERO
    line = 40.0 * np.cos(place + 0.7) + 15.0 * np.cos(2.0 * place - 1.0)
    motor = 20.0 * np.cos(RATIO * theta + 0.5)
    error = ZERO + ARCSEC * (line + motor + 0.5 * PLAY * way + NOISE * rng.normal(size=size))
    return {
        "time_s": phase * 3.3 / 2.5,
        "motor_rad": RATIO * theta,
        "indicated_rad": theta + error - DELAY * speed,
    }


def selfcal(log: dict[str, np.ndarray], **more) -> ta.SelfCalibration:
    return ta.selfcal(
        log, method="dual", orders=[1, 2], gear_ratio=more.pop("ratio", RATIO), **more
    )


@pytest.fixture(scope="module")
def found() -> list[ta.SelfCalibration]:
    print("seeds", SEEDS)
    return [selfcal(there_and_back(seed)) for seed in SEEDS]


HIDDEN = {
    "delay_s": ("delay_std_s", DELAY),
    "reversal_error_arcsec": ("reversal_error_std_arcsec", PLAY),
    "gear_ratio_measured": ("gear_ratio_std", RATIO),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_what_is_hidden_is_told_beside(name: str, found: list[ta.SelfCalibration]) -> None:
    std, hidden = HIDDEN[name]
    pulls = [(one.beside[name] - hidden) / one.beside[std] for one in found]
    print(name, np.mean(pulls), np.std(pulls))
    assert abs(np.mean(pulls)) < CENTRED
    assert found[0].beside[std] < abs(hidden) / 3.0


def test_numbers_and_errors_are_those_of_least_squares(found: list[ta.SelfCalibration]) -> None:
    """All columns of the readings away from reversals, beside a zero, solved at once."""
    log, one = there_and_back(SEED), found[0]
    theta = log["motor_rad"] / RATIO
    way, speed = gear_motion(theta, log["time_s"])
    kept = ~near_reversal(way)
    # The output's waves begin at the median of its zero, which moves them by nothing seen.
    place = theta + float(np.median(log["indicated_rad"] - theta))
    waves = [
        f(o.order * (place if o.order in (1.0, 2.0) else theta))
        for o in one.orders
        for f in (np.cos, np.sin)
    ]
    columns = np.column_stack([*waves, way, speed, np.ones(theta.size)])[kept]
    target = (log["indicated_rad"] - theta)[kept]
    x, squares, *_ = np.linalg.lstsq(columns, target, rcond=None)
    variance = float(squares[0]) / (target.size - columns.shape[1])
    spread = variance * np.linalg.inv(columns.T @ columns)
    std = np.sqrt(np.diag(spread))
    beside = one.beside
    for name, value in (
        ("reversal_error_arcsec", 2.0 * x[-3] / ARCSEC),
        ("reversal_error_std_arcsec", 2.0 * std[-3] / ARCSEC),
        ("delay_s", -x[-2]),
        ("delay_std_s", std[-2]),
    ):
        assert beside[name] == pytest.approx(value, rel=2e-4), name
    assert one.noise_arcsec == pytest.approx(math.sqrt(variance) / ARCSEC, rel=1e-4)
    for k, o in enumerate(one.orders):
        pair = slice(2 * k, 2 * k + 2)
        size = float(np.hypot(*x[pair]))
        along = x[pair] / size
        assert o.amplitude == pytest.approx(size / ARCSEC, rel=1e-3)
        error = math.sqrt(along @ spread[pair, pair] @ along)
        assert o.std == pytest.approx(error / ARCSEC, rel=1e-3), o
        limit = one.noise_arcsec * math.sqrt(2.0 / theta.size)
        assert o.std_factor == pytest.approx(o.std / limit, rel=0.1), o


def test_lines_come_back_with_their_phase_and_error(found: list[ta.SelfCalibration]) -> None:
    """The output's at its own angle; the motor's at the corrected output of the first run."""
    hidden = {1.0: (40.0, 0.7), 2.0: (15.0, -1.0), RATIO: (20.0, 0.5)}
    for order, (amplitude, phase) in hidden.items():
        pulls = []
        for one in found:
            (o,) = [o for o in one.orders if math.isclose(o.order, order)]
            wave = amplitude * np.exp(-1j * phase)
            z = complex(o.cosine, o.sine) - wave
            pulls.append(abs(z) ** 2 / o.std**2)
        # Two degrees of freedom each.
        print(order, np.mean(pulls))
        assert np.mean(pulls) == pytest.approx(2.0, abs=4.5 * 2.0 / math.sqrt(10.0))


def test_one_part_predicts_the_other_as_noise_says(found: list[ta.SelfCalibration]) -> None:
    """What is left of one part is its noise, and that of the other's patterns."""
    (name,) = found[0].held_out
    tests = [one.held_out[name] for one in found]
    # Ten lines of each half's 350 readings; 4.5 errors of the square of 10 times 350.
    after, error = NOISE**2 * (1.0 + 20.0 / 350.0), 4.5 * math.sqrt(2.0 / (10.0 * 350.0))
    assert np.mean([t.rms_after**2 for t in tests]) == pytest.approx(after, rel=error)
    lines = 0.5 * (40.0**2 + 15.0**2 + 20.0**2)
    assert np.mean([t.rms_before**2 for t in tests]) == pytest.approx(lines + NOISE**2, rel=0.1)
    assert np.mean([one.noise_arcsec for one in found]) == pytest.approx(NOISE, rel=0.02)


def test_p_is_that_of_patterns_fitted_to_each_part(found: list[ta.SelfCalibration]) -> None:
    """Fisher's F of two fits by themselves, with the freedom that both leave for the noise."""
    log = there_and_back(SEED)
    theta = log["motor_rad"] / RATIO
    way, speed = gear_motion(theta, log["time_s"])
    place = theta + float(np.median(log["indicated_rad"] - theta))
    columns = [
        f(o.order * (place if o.order in (1.0, 2.0) else theta))
        for o in found[0].orders
        for f in (np.cos, np.sin)
    ]
    design = np.column_stack([*columns, way, speed, np.ones(theta.size)])
    size, fits, spread, left, freedom = len(columns), [], 0.0, 0.0, 0
    for first in (0, 1):  # even and odd ones of 20 blocks of the run
        part = (np.arange(700) // 35 % 2 == first) & ~near_reversal(way)
        rows, target = design[part], (log["indicated_rad"] - theta)[part]
        x, squares, *_ = np.linalg.lstsq(rows, target, rcond=None)
        spread = spread + np.linalg.inv(rows.T @ rows)[:size, :size]
        left += squares[0]
        freedom += len(rows) - rows.shape[1]
        fits.append(x[:size])
    gap = fits[1] - fits[0]
    told = stats.f.sf(gap @ np.linalg.solve(spread, gap) / size / (left / freedom), size, freedom)
    assert found[0].held_out["blocks"].p == pytest.approx(told, rel=2e-3)


@pytest.mark.parametrize(("memory", "part"), [(0.0, 1.0), (0.0, 0.5), (0.5, 1.0)])
def test_halves_differ_by_noise_as_often_as_p_says(memory: float, part: float) -> None:
    """Uniform by Kolmogorov's distance, by mean and logarithm; a pattern that changed is seen."""
    size, ps = 1500 if memory else 500, []
    print("seeds", SEEDS)
    for seed in range(SEED, SEED + 24):
        log = there_and_back(seed, size)
        if memory:
            shocks = 2.0 * NOISE * ARCSEC * np.random.default_rng(seed + 900).normal(size=size)
            log["indicated_rad"] += signal.lfilter([1.0], [1.0, -memory], shocks)
        log = {name: v[: round(part * size)] for name, v in log.items()}
        (test,) = selfcal(log).held_out.values()
        ps.append(test.p)
    print(np.sort(ps))
    assert np.abs(np.sort(ps) - (np.arange(24) + 0.5) / 24).max() < 1.95 / math.sqrt(24.0)
    assert np.mean(ps) == pytest.approx(0.5, abs=4.5 * math.sqrt(1.0 / 12.0 / 24.0))
    assert -np.mean(np.log(ps)) == pytest.approx(1.0, abs=4.5 / math.sqrt(24.0))
    rows = log["motor_rad"].size
    blocks = 2 if part < 1.0 else 20  # one sweep there and back, or two over other travels
    other = np.arange(rows) * blocks // rows % 2
    moved = 4.0 * NOISE * ARCSEC * np.cos(2.0 * log["indicated_rad"])
    log["indicated_rad"] = log["indicated_rad"] + other * moved
    (test,) = selfcal(log).held_out.values()
    assert test.p < 1e-3


def test_the_model_takes_off_the_lines_of_both_shafts(found: list[ta.SelfCalibration]) -> None:
    """Where the motor's lines stand at the output is told with their phase."""
    log = there_and_back(SEED)
    theta = log["motor_rad"] / RATIO
    way, speed = gear_motion(theta, log["time_s"])
    read = log["indicated_rad"] + DELAY * speed - 0.5 * PLAY * ARCSEC * way
    left = np.radians(found[0].model.correct(np.degrees(read))) - theta
    # 700 readings tell their deviation to 2.7 %, and 20 coefficients follow them.
    assert np.std(left[~near_reversal(way)]) / ARCSEC == pytest.approx(NOISE, rel=0.12)


def told(one: ta.SelfCalibration) -> dict[str, object]:
    """Every number, without words."""
    return {
        "orders": [(o.order, o.cosine, o.sine, o.std, o.retained) for o in one.orders],
        "beside": one.beside,
        "held_out": [(t.rms_before, t.rms_after, t.p) for t in one.held_out.values()],
        "noise": (one.noise_arcsec, one.readings, one.turns),
    }


def flat(value: object) -> list[float]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return [x for part in value for x in flat(part)]
    return [float(value)]  # type: ignore[arg-type]


def test_readings_and_turns_are_counted(found: list[ta.SelfCalibration]) -> None:
    one = found[0]
    assert one.readings == 700
    assert one.turns == pytest.approx(6.6 / (2.0 * math.pi), rel=1e-4)


def test_part_of_a_turn_holds_for_its_travel_and_the_noise_of_its_ends() -> None:
    """The model's span: true places of the ends, and four deviations of a reading beyond."""
    log = {name: v[:175] for name, v in there_and_back(SEED).items()}
    one = selfcal(log)
    place = np.degrees(log["motor_rad"] / RATIO + ZERO)
    room = 4.0 * one.noise_arcsec / 3600.0
    start, stop = one.model.fit.span  # type: ignore[union-attr]
    # The zero is told to some arcsec by a fit to half a turn.
    assert (stop - start) % 360.0 == pytest.approx(np.ptp(place) + 2.0 * room, abs=1e-6)
    assert (start + room - place.min()) % 360.0 == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("unit", ["deg", "turn"])
def test_every_unit_gives_the_same_numbers(found: list[ta.SelfCalibration], unit: str) -> None:
    log = there_and_back(SEED)
    scale = {"deg": 180.0 / math.pi, "turn": 0.5 / math.pi}[unit]
    other = {
        name.replace("_rad", f"_{unit}"): v * (scale if name.endswith("_rad") else 1.0)
        for name, v in log.items()
    }
    np.testing.assert_allclose(flat(told(selfcal(other))), flat(told(found[0])), rtol=1e-6)


def test_a_mirrored_joint_has_mirrored_numbers(found: list[ta.SelfCalibration]) -> None:
    """Both angles turned round: waves keep their cosine; a delay stays one, and play too."""
    log = there_and_back(SEED)
    for name in ("motor_rad", "indicated_rad"):
        log[name] = -log[name]
    one, two = told(found[0]), told(selfcal(log))
    one["orders"] = [(k, -a, b, s, r) for k, a, b, s, r in one["orders"]]  # type: ignore[attr-defined]
    np.testing.assert_allclose(flat(two), flat(one), rtol=1e-5)


def test_a_motor_that_turns_the_other_way_is_a_negative_ratio(
    found: list[ta.SelfCalibration],
) -> None:
    log = there_and_back(SEED)
    log["motor_rad"] = -log["motor_rad"]
    two = told(selfcal(log, ratio=-RATIO))
    one = told(found[0])
    for name in ("gear_ratio", "gear_ratio_measured"):
        one["beside"] = {**one["beside"], name: -one["beside"][name]}  # type: ignore[index,dict-item]
    np.testing.assert_allclose(flat(two), flat(one), rtol=1e-6)
