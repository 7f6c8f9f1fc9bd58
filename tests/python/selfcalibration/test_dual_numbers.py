"""Numbers beside the patterns of two encoders: delay, reversal, ratio, what predicts what."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from scipy import signal, stats

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.cli import main
from trueangle.errors import ArgumentError
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


#: Standard errors beyond which none of the few dozen estimates of this file comes by chance.
FAR = 4.0

#: Sweeps of a joint drawn at random.
SWEEPS = 200

#: What the estimate of a noise of 3 arcsec from 800 readings may be off by: four standard
#: errors, 10 %.
DUAL_NOISE = (2.7, 3.3)


def joint(theta, ratio, lines, rng, motor=((20.0, 1.0), (8.0, 0.2)), noise=3.0):
    """Both readings; ``lines`` are amplitude (arcsec) and phase of orders 1, 2 ... ."""
    error = sum(a * np.sin((k + 1) * theta + p) for k, (a, p) in enumerate(lines))
    turned = ratio * theta
    own = sum(a * np.sin((k + 1) * turned + p) for k, (a, p) in enumerate(motor))
    return {
        "motor_rad": turned + ARCSEC * own,
        "indicated_rad": theta + ARCSEC * (error + noise * rng.normal(size=theta.size)),
    }


def left_rms(model, log, theta):
    """What a model leaves of the output's error, arcsec, without the zero."""
    corrected = model.correct(np.degrees(log["indicated_rad"]))
    return float(np.std(corrected - np.degrees(theta)) * 3600.0)


@pytest.mark.parametrize("travel", [298.0, 420.0])
@pytest.mark.parametrize("second", [0.0, 90.0])
def test_an_eccentric_output_is_no_other_ratio(travel, second):
    theta = np.radians(np.linspace(0.0, travel, 1500))
    log = joint(theta, 101.0, [(450.0, 0.5), (second, 1.2)], np.random.default_rng(4101))
    found = ta.selfcal(log, method="dual", gear_ratio=101)
    assert found.beside["gear_ratio"] == 101.0
    assert not [note for note in found.notes if "gear ratio" in note]
    assert DUAL_NOISE[0] < found.noise_arcsec < DUAL_NOISE[1]
    first = found.orders[0]
    assert first.order == 1.0
    assert abs(first.amplitude - 450.0) < FAR * first.std < 1.0
    assert left_rms(found.model, log, theta) < DUAL_NOISE[1]
    if travel < 360.0:
        assert found.model.partial_span == pytest.approx((0.0, travel), abs=0.1)
        assert any("within this travel" in note for note in found.notes)


def test_order_1_alone_stands_out():
    theta = np.radians(np.linspace(-40.0, 150.0, 900))
    log = joint(theta, 80.0, [(60.0, 2.0)], np.random.default_rng(4102), motor=())
    found = ta.selfcal(log, gear_ratio=80)
    assert [o.order for o in found.orders] == [1.0]
    assert found.held_out["blocks"].rms_after < DUAL_NOISE[1]


def test_random_sweeps_claim_no_other_ratio():
    seeds = range(8800, 8800 + SWEEPS)
    print("seeds", seeds)
    pulls = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        teeth = int(rng.integers(30, 161)) * int(rng.choice([-1, 1]))
        theta = np.radians(rng.uniform(-180, 180) + np.linspace(0.0, rng.uniform(120, 400), 800))
        if seed % 3 == 0:
            theta = np.concatenate([theta, theta[::-1]])
        lines = [(rng.uniform(20, 500), rng.uniform(0, 6.3)) for _ in range(2)]
        log = joint(theta, teeth, lines, rng)
        given = ta.selfcal(log, method="dual", gear_ratio=teeth)
        asked = ta.selfcal(log, method="dual", gear_ratio=teeth, fit_ratio=True)
        alone = ta.selfcal(log, method="dual")
        assert not [note for note in given.notes if "gear ratio" in note], seed
        assert DUAL_NOISE[0] < given.noise_arcsec < DUAL_NOISE[1], seed
        assert {given.beside["gear_ratio"], asked.beside["gear_ratio"]} == {teeth}, seed
        # Over a short arc any of several counts of teeth explains them: that is said.
        if alone.beside["gear_ratio"] != teeth:
            assert any("give the count of teeth" in note for note in alone.notes), seed
        std = asked.beside["gear_ratio_std"]
        if std is None:  # a third of a turn may not tell it from orders of the output
            assert any("do not separate the gear ratio" in note for note in asked.notes), seed
        else:
            pulls.append((asked.beside["gear_ratio_measured"] - teeth) / std)
    assert len(pulls) >= 0.95 * SWEEPS
    assert max(map(abs, pulls)) < FAR
    # Of 190 pulls or more; four standard errors of their spread are 0.2.
    assert 0.8 < np.std(pulls) < 1.2


def test_correlated_noise_widens_the_interval_of_the_ratio():
    pulls = []
    for seed in range(4110, 4122):
        rng = np.random.default_rng(seed)
        theta = np.linspace(0.0, 5.0, 1500)
        log = joint(theta, 90.0, [(200.0, 1.0), (80.0, 4.0)], rng, noise=0.0)
        wander = rng.normal(size=theta.size)
        for i in range(1, wander.size):
            wander[i] = 0.93 * wander[i - 1] + 0.3676 * wander[i]
        log["indicated_rad"] = log["indicated_rad"] + 3.0 * ARCSEC * wander
        beside = ta.selfcal(log, gear_ratio=90, fit_ratio=True).beside
        assert beside["gear_ratio"] == 90.0
        pulls.append((beside["gear_ratio_measured"] - 90.0) / beside["gear_ratio_std"])
    assert max(map(abs, pulls)) < FAR


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wrong_count_of_teeth_is_told_and_put_right(sign, tmp_path, capsys):
    theta = np.radians(np.linspace(10.0, 300.0, 1200))
    log = joint(theta, sign * 100.0, [(150.0, 0.5)], np.random.default_rng(4103))
    kept = ta.selfcal(log, method="dual", gear_ratio=sign * 101)
    assert kept.beside["gear_ratio"] == sign * 101.0
    assert any("fit_ratio=True" in note for note in kept.notes)
    columns = np.column_stack([np.degrees(log["motor_rad"]), np.degrees(log["indicated_rad"])])
    path, model = tmp_path / "joint.csv", tmp_path / "joint.json"
    header = "motor_deg,indicated_deg"
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.9f")
    ratio = f"--gear-ratio={sign * 101:g}"
    assert main(["selfcal", str(path), "-o", str(model), ratio, "--fit-ratio", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["beside"]["gear_ratio"] == sign * 100.0
    assert left_rms(ta.load_model(model), log, theta) < DUAL_NOISE[1]


def test_readings_at_a_reversal_take_no_part():
    there = np.radians(np.linspace(20.0, 250.0, 700))
    theta = np.concatenate([there, there[::-1]])
    log = joint(theta, 60.0, [(120.0, 1.5)], np.random.default_rng(4104))
    play = 60.0 * np.repeat([1.0, -1.0], 700)
    log["indicated_rad"] = log["indicated_rad"] + ARCSEC * play
    found = ta.selfcal(log, gear_ratio=60, fit_ratio=True)
    assert found.beside["gear_ratio"] == 60.0
    assert DUAL_NOISE[0] < found.noise_arcsec < DUAL_NOISE[1]
    assert found.beside["reversal_error_arcsec"] == pytest.approx(120.0, abs=1.0)


def test_a_ratio_is_fitted_of_two_encoders_only():
    theta = np.linspace(0.0, 60.0, 4000)
    with pytest.raises(ArgumentError, match="fit_ratio"):
        ta.selfcal({"time_s": theta, "indicated_rad": theta}, fit_ratio=True)


@pytest.mark.parametrize("turns", [0.02, 0.4, 0.85])
def test_less_than_a_turn_of_the_motor_is_refused_with_what_to_record(turns, tmp_path, capsys):
    """Before, orders of up to 365 arcsec were fitted to a fraction of a turn."""
    rng = np.random.default_rng(4188)
    motor = np.linspace(0.0, 360.0 * turns, 900)
    motor = np.concatenate([motor, motor[::-1]])
    error = 1.7 * np.tanh(motor / 5.0) - 0.2 * motor + 0.6 * rng.normal(size=motor.size)
    table = np.column_stack([20.0 - motor / 63.0 + error * ARCSEC * 180.0 / np.pi, motor])
    log, out = tmp_path / "short.csv", tmp_path / "m.json"
    np.savetxt(log, table, "%.8f", ",", header="indicated_deg,motor_deg", comments="")
    for extra in ([], ["--gear-ratio", "-63"], ["--orders", "1"]):
        assert main(["selfcal", str(log), "-o", str(out), "--method", "dual", *extra]) != 0
        told = " ".join(capsys.readouterr().err.split())
        assert re.search(rf"short.csv: the motor made only {turns:.2g} turns", told)
        assert not out.exists()
        advice = re.search(r"Record more: trueangle (.+) plans the travel$", told)
        assert main(advice[1].split()) == 0
        assert re.search(r"record 3 turns\n", capsys.readouterr().out)


def test_one_turn_of_the_motor_is_enough_for_its_eccentricity():
    theta = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False) / 63.0
    log = joint(theta, 63.0, [], np.random.default_rng(4189), ((300.0, 1.0),), 0.1)
    found = ta.selfcal(log, method="dual", gear_ratio=63, orders=[1])
    size = {round(o.order): o for o in found.orders}[63]
    assert abs(size.amplitude - 300.0 / 63.0) < FAR * size.std
