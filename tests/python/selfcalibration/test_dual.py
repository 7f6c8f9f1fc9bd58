"""A geared joint over part of a turn: the count of teeth stays, low orders are told."""

import json
import re

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.cli import main
from trueangle.errors import ArgumentError

#: Standard errors beyond which none of the few dozen estimates of this file comes by chance.
FAR = 4.0

#: Sweeps of a joint drawn at random.
SWEEPS = 200

#: What the estimate of a noise of 3 arcsec from 800 readings may be off by: four standard
#: errors, 10 %.
NOISE = (2.7, 3.3)


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
    assert NOISE[0] < found.noise_arcsec < NOISE[1]
    first = found.orders[0]
    assert first.order == 1.0
    assert abs(first.amplitude - 450.0) < FAR * first.std < 1.0
    assert left_rms(found.model, log, theta) < NOISE[1]
    if travel < 360.0:
        assert found.model.partial_span == pytest.approx((0.0, travel), abs=0.1)
        assert any("within this travel" in note for note in found.notes)


def test_order_1_alone_stands_out():
    theta = np.radians(np.linspace(-40.0, 150.0, 900))
    log = joint(theta, 80.0, [(60.0, 2.0)], np.random.default_rng(4102), motor=())
    found = ta.selfcal(log, gear_ratio=80)
    assert [o.order for o in found.orders] == [1.0]
    assert found.held_out["blocks"].rms_after < NOISE[1]


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
        assert NOISE[0] < given.noise_arcsec < NOISE[1], seed
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
    assert left_rms(ta.load_model(model), log, theta) < NOISE[1]


def test_readings_at_a_reversal_take_no_part():
    there = np.radians(np.linspace(20.0, 250.0, 700))
    theta = np.concatenate([there, there[::-1]])
    log = joint(theta, 60.0, [(120.0, 1.5)], np.random.default_rng(4104))
    play = 60.0 * np.repeat([1.0, -1.0], 700)
    log["indicated_rad"] = log["indicated_rad"] + ARCSEC * play
    found = ta.selfcal(log, gear_ratio=60, fit_ratio=True)
    assert found.beside["gear_ratio"] == 60.0
    assert NOISE[0] < found.noise_arcsec < NOISE[1]
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
        assert re.search(r"turns +3\n", capsys.readouterr().out)


def test_one_turn_of_the_motor_is_enough_for_its_eccentricity():
    theta = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False) / 63.0
    log = joint(theta, 63.0, [], np.random.default_rng(4189), ((300.0, 1.0),), 0.1)
    found = ta.selfcal(log, method="dual", gear_ratio=63, orders=[1])
    size = {round(o.order): o for o in found.orders}[63]
    assert abs(size.amplitude - 300.0 / 63.0) < FAR * size.std
