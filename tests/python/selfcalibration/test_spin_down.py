"""Spin-down: the limit is reached, stated errors hold, what is blind is refused."""

import json
import math

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC, coast, coefficients, encoder, held_by_loop
from trueangle import cli
from trueangle.errors import ArgumentError, FileError, NoModelError

LINES = {1: (300.0, 0.3), 2: (150.0, 1.0), 4: (50.0, 2.0)}
SIGMA = 20.0

#: Standard deviations that no estimate of a test may be off: one in 15 000 beyond 4.
FAR = 4.0


def log_of(t, theta, seed, lines=LINES, sigma=SIGMA, **columns):
    print("seed", seed)
    noise = np.random.default_rng(seed).normal(size=t.size) * sigma * ARCSEC
    reading = np.mod(theta + encoder(theta, lines) + noise, 2.0 * np.pi)
    return {"time_s": t, "indicated_rad": reading, **columns}


def off(found, lines=LINES):
    """Errors in standard deviations and in arcsec, of cosine and sine in turn."""
    values = np.array([v for o in found.orders for v in (o.cosine, o.sine)])
    std = np.array([o.std for o in found.orders for _ in range(2)])
    error = values - coefficients(lines)
    return error / std, error


def test_coasting_reaches_the_limit_of_white_noise():
    t, theta = coast(10.0, 2.0, 20.0)
    found = ta.selfcal(log_of(t, theta, 7001), orders=[1, 2, 4], loop="open", ripple="none")
    limit = SIGMA * math.sqrt(2.0 / t.size)
    for order in found.orders:
        assert limit < 1.02 * order.std
        assert order.std < 1.05 * limit
        assert 0.97 < order.retained <= 1.0
    assert np.abs(off(found)[0]).max() < FAR
    assert found.noise_arcsec == pytest.approx(SIGMA, rel=0.03)


def test_ripple_of_a_real_rotor_is_told_from_the_encoder():
    # 200 arcsec of order 1 at the mean speed of 4.5 turns per second.
    size = 200.0 * ARCSEC * (2.0 * np.pi * 4.47) ** 2
    t, theta = coast(10.0, 2.0, 20.0, ripple={1: size})
    log = log_of(t, theta, 7002)
    found = ta.selfcal(log, orders=[1, 2, 4], loop="open")
    assert np.abs(off(found)[0]).max() < FAR
    ripple = found.beside["ripple"][0]
    assert ripple["probability"] > 0.999
    assert ripple["amplitude_arcsec"] == pytest.approx(200.0, rel=0.05)
    assert not found.held_out["speeds"].p > 1e-6  # the only test that shows ripple
    blind = ta.selfcal(log, orders=[1, 2, 4], loop="open", ripple="none")
    assert abs(off(blind)[1][0]) > 30.0  # what not modelling it would cost


def test_one_speed_says_encoder_or_ripple():
    size = 200.0 * ARCSEC * (2.0 * np.pi * 5.0) ** 2
    t, theta = coast(5.0, 5.0, 8.0, ripple={1: size})
    found = ta.selfcal(log_of(t, theta, 7003), orders=[1, 2, 4], loop="open")
    assert 1.0 not in [o.order for o in found.orders]
    said = [b for b in found.blind if 1.0 in b.orders]
    assert said
    assert "encoder or ripple" in said[0].because
    assert [o.of for o in found.sums if o.order == 1.0] == ["the encoder or the speed ripple"]


def test_orders_that_a_loop_follows_are_refused():
    t, theta, _ = held_by_loop(3.0, 4.0, 10.0, LINES)
    log = log_of(t, theta, 7004, sigma=5.0)
    found = ta.selfcal(log, orders=[1, 2, 4], loop="closed", loop_bandwidth=4.0)
    assert [o.order for o in found.orders] == [4.0]
    assert {1.0, 2.0} <= {k for b in found.blind for k in b.orders}
    assert "encoder or loop" in found.blind[1].because


@pytest.mark.parametrize("loop", ["unknown", "closed"])
def test_an_unknown_loop_gives_no_number(loop, tmp_path, capsys):
    t, theta = coast(10.0, 2.0, 10.0)
    found = ta.selfcal(log_of(t, theta, 7005), orders=[1, 2, 4], loop=loop)
    assert found.orders == ()
    assert any("encoder or loop" in b.because for b in found.blind)
    assert found.model.shafts == ()


def test_wandering_friction_is_followed():
    rng = np.random.default_rng(7006)
    t, theta = coast(10.0, 2.0, 20.0, wander=0.5, rng=rng, steps=1)
    found = ta.selfcal(log_of(t, theta, 7007), orders=[1, 2, 4], loop="open", ripple="none")
    assert np.abs(off(found)[0]).max() < FAR
    assert found.noise_arcsec == pytest.approx(SIGMA, rel=0.05)
    assert found.orders[0].std < 2.0


def test_the_command_writes_a_model_that_says_what_it_is(tmp_path, capsys):
    t, theta = coast(10.0, 2.0, 10.0)
    log = log_of(t, theta, 7008)
    path, out = tmp_path / "coast.csv", tmp_path / "joint.json"
    rows = np.column_stack([log["time_s"], np.degrees(log["indicated_rad"])])
    np.savetxt(path, rows, delimiter=",", header="time_s,indicated_deg", comments="", fmt="%.9f")
    capsys.readouterr()
    assert cli.main(["selfcal", str(path), "-o", str(out), "--loop", "open", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [o["order"] for o in told["orders"]] == [1, 2, 4]
    assert set(told["orders"][0]) >= {
        "order",
        "amplitude_arcsec",
        "phase_deg",
        "std_arcsec",
        "retained",
        "std_factor",
    }
    assert told["blind"][0]["orders"] == [0]
    model = ta.load_model(out)
    assert model.fit.calibrated_without_reference
    assert any("zero" in said for said in model.fit.blind)
    left = np.degrees(encoder(theta, LINES)) - model.error(np.degrees(theta))
    assert np.std(left) * 3600.0 < 2.0


def test_what_to_record_is_said(tmp_path):
    t, theta = coast(10.0, 2.0, 10.0)
    log = log_of(t, theta, 7009)
    untimed = tmp_path / "untimed.csv"
    np.savetxt(untimed, np.degrees(log["indicated_rad"]), header="indicated_deg", comments="")
    with pytest.raises(FileError, match="record a time stamp"):
        ta.selfcal(untimed, method="spin-down", loop="open")
    once = {name: values[:100] for name, values in log.items()}
    with pytest.raises(NoModelError, match="record at least 10 turns"):
        ta.selfcal(once, loop="open")
    few = {name: values[::60] for name, values in log.items()}
    few["indicated_rad"] = few["indicated_rad"] * 0.0 + 0.1 * np.arange(few["time_s"].size)
    with pytest.raises(NoModelError, match="only 167 readings in motion; record at least 10 turns"):
        ta.selfcal({name: np.mod(v, 2.0 * np.pi) if "rad" in name else v
                    for name, v in few.items()}, loop="open")  # fmt: skip
    fast = {name: values[::60] for name, values in log.items()}
    with pytest.raises(NoModelError, match="turn slower"):
        ta.selfcal(fast, loop="open")
    with pytest.raises(ArgumentError, match="loop_bandwidth"):
        ta.selfcal(log, loop="open", loop_bandwidth=2.0)


def test_resolver_on_a_stepper(data_dir):
    runs = ta.read_runs(data_dir / "resolver_stepper.csv")
    found = ta.selfcal(data_dir / "resolver_stepper.csv", loop="open")
    run = runs[0]
    gap = ta.wrap(run.indicated - run.reference, 360.0)
    corrected = found.model.correct(np.unwrap(run.indicated, period=360.0))
    left = ta.wrap(corrected - run.reference, 360.0)
    left = ta.wrap(left - ta.wrap(np.median(left), 360.0), 360.0)
    assert np.std(gap) * 3600.0 > 15_000.0
    assert np.std(left) * 3600.0 < 252.0  # the prototype


def test_magnetic_encoder_in_a_loop(data_dir):
    path = data_dir / "rm44_repeat.csv"
    found = ta.selfcal(path, loop="closed", loop_bandwidth=1.2)
    given = {o.order: o for o in found.orders}
    assert not {1.0, 2.0} & set(given)
    assert {1.0, 2.0} <= {k for b in found.blind for k in b.orders}
    fit = ta.fit(ta.read_runs(path), orders=range(1, 13))
    for k in (3, 4, 5):
        a, b = fit.model.shafts[0].cosine[k - 1], fit.model.shafts[0].sine[k - 1]
        # The same pattern counted from the encoder's own zero.
        turned = complex(a, b) * np.exp(1j * np.radians(k * fit.model.constant))
        assert abs(complex(given[k].cosine, given[k].sine) / 3600.0 - turned) < 0.010
