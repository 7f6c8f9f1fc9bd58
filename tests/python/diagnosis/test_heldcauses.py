"""Gains of causes on readings held out, the share and its interval, and what confirms them."""

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.confirmation import confirmation_status
from trueangle.diagnosis.gain import Gain, measure_gain
from trueangle.diagnosis.goodness import Noise, Unexplained
from trueangle.diagnosis.holdout import held_out_residuals, reducible_share
from trueangle.diagnosis.result import Diagnosis
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

JOINT = Joint(50.0, "circular_spline", "motor")
SIM = Simulation(
    JOINT,
    (Harmonic("output", 1, 14.0, 243.0),),
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(samples=100, start_deg=31.0 * k, turns=1.3, reversals=(0.3, 0.6))
        for k in range(10)
    ),
)


@pytest.fixture(scope="module")
def signals():
    return join_runs(ta.simulate(SIM, 3))


def with_backlash(signals, size, seed=5):
    noise = np.random.default_rng(seed).standard_normal(len(signals))
    fitted = Regression.of(signals, noise + size * signals.direction, SIM.surroundings, rho=0.0)
    return fitted.with_terms([EFFECTS["backlash"].propose(fitted)])


def test_held_out_readings_take_no_part_in_the_fit(signals):
    """By lstsq on the others, with the cause and without it."""
    fitted = with_backlash(signals, 3.0)
    test = signals.run < 2
    with_it, without = held_out_residuals(fitted, [[0]], test, own_zero=False)
    for design, found in (
        (np.hstack([fitted.base, signals.direction[:, None]]), with_it),
        (fitted.base, without),
    ):
        y = np.where(fitted.outlying, np.nan, fitted.residual)
        keep = ~test & np.isfinite(y)
        coefficients = np.linalg.lstsq(design[keep], y[keep], rcond=None)[0]
        # Readings beyond four deviations are taken less large: few, and of little weight.
        np.testing.assert_allclose(
            found, fitted.residual[test] - design[test] @ coefficients, atol=0.05
        )
    # A reading that is held out may be anything: the model is the same.
    fitted.residual[test] += 1000.0 * np.random.default_rng(1).normal(size=test.sum())
    moved = held_out_residuals(fitted, [[0]], test, own_zero=False)[0]
    np.testing.assert_allclose(fitted.residual[test] - moved, (y[test] - with_it), atol=1e-9)


def test_the_gain_is_that_of_all_readings_each_held_out_once(signals):
    fitted = with_backlash(signals, 3.0)
    (gain,) = measure_gain(fitted, [[0]])
    noise = np.random.default_rng(5).standard_normal(len(signals))
    # What is left with the cause is the noise; without it, the reversal error too.
    assert gain.after[0] == pytest.approx(noise.std(), rel=0.03)
    assert gain.before[0] == pytest.approx(
        np.hypot(noise.std(), 3.0 * signals.direction.std()), rel=0.05
    )
    assert gain.reducible_share == pytest.approx(1.0, abs=0.02)
    low, high = gain.interval
    assert low <= gain.reducible_share <= high
    # With the directions of half of the runs turned round there is nothing to gain.
    assert gain.control_share < 0.2


def test_the_share_is_that_of_what_can_be_reduced_and_its_interval_holds_95_percent():
    rng = np.random.default_rng(6)
    unit = np.repeat(np.arange(12), 50)
    sizes = rng.uniform(1.0, 3.0, 12)
    before = rng.normal(size=unit.size) + (sizes * rng.choice([-1, 1], 12))[unit]
    after = rng.normal(size=unit.size) * rng.uniform(0.8, 1.6, 12)[unit]
    share, (low, high) = reducible_share(before, after, unit, 1.0, rng)
    p0, p1 = np.mean(before**2), np.mean(after**2)
    assert share == pytest.approx((p0 - p1) / (p0 - 1.0), rel=1e-12)
    pick = rng.integers(12, size=(40_000, 12))
    power0 = np.array([np.mean(before[unit == k] ** 2) for k in range(12)])
    power1 = np.array([np.mean(after[unit == k] ** 2) for k in range(12)])
    q0, q1 = power0[pick].mean(axis=1), power1[pick].mean(axis=1)
    draws = (q0 - q1) / (q0 - 1.0)
    # 1000 resamples know their own 2.5 % to a tenth of the width.
    wanted = np.quantile(draws, [0.025, 0.975])
    assert (low, high) == pytest.approx(tuple(wanted), abs=0.1 * (wanted[1] - wanted[0]))


@pytest.mark.parametrize("gained", [1.0, 0.0])
def test_runs_at_which_a_cause_does_not_act_say_nothing_of_its_share(gained):
    """Loads in two of four runs: a draw of the other two has nothing to take off."""
    rng = np.random.default_rng(16)
    unit = np.repeat(np.arange(4), 200)
    noise, load = rng.normal(size=unit.size), np.array([0.0, 5.0, 0.0, -5.0])[unit]
    share, (low, high) = reducible_share(
        noise + load, noise + (1.0 - gained) * load, unit, 1.0, rng
    )
    assert share == pytest.approx(gained, abs=0.02)
    assert low == pytest.approx(gained, abs=0.05)
    assert high == pytest.approx(gained, abs=0.05)


def test_a_mean_of_runs_that_all_show_noise_alone_is_drawn_from_all_of_them():
    rng = np.random.default_rng(17)
    unit = np.repeat(np.arange(4), 200)
    before = rng.normal(size=unit.size)
    _, (low, high) = reducible_share(before, before * 1.01, unit, 1.0, rng)
    assert (low, high) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("interval", "status"),
    [
        ((0.2, 0.9), "confirmed"),
        ((0.01, 0.9), "confirmed"),
        ((-0.01, 0.9), "not_confirmed"),
        ((-0.9, -0.1), "not_confirmed"),
    ],
)
def test_a_cause_is_confirmed_where_the_interval_of_its_gain_excludes_zero(interval, status):
    zeros = (0.0, 0.0, 0.0)
    gain = Gain("runs", zeros, zeros, sum(interval) / 2.0, interval, None, "")
    nothing = Unexplained(False, 0.0, 0.0, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0, 0.0))
    found, reason = confirmation_status("backlash", gain, None, (), nothing)
    assert found == status
    assert bool(reason) == (status == "not_confirmed")


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("unexplained", [False, True])
@pytest.mark.parametrize("verdict", ["confirmed", "absent"])
def test_a_simulation_is_enough_where_nothing_is_left(unexplained, verdict, complete):
    made = SimpleNamespace(
        complete=complete, findings=[], unexplained=SimpleNamespace(found=unexplained),
        beliefs=[SimpleNamespace(verdict=verdict)],
    )  # fmt: skip
    made.wrong = Diagnosis.wrong.fget(made)
    enough = complete and not unexplained and verdict == "confirmed"
    assert Diagnosis.is_enough.fget(made) == enough
    made.findings = ["something"]
    assert not Diagnosis.is_enough.fget(made)
