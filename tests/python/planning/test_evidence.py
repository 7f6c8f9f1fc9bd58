"""Expected evidence between causes: dense generalised least squares, identities, a simulation."""

import secrets

import numpy as np
import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.planning.evidence import (
    ExpectedEvidence,
    Hypothesis,
    ReadingNoise,
    evidence_between,
    is_doubted,
)
from trueangle.planning.worth import effect_of_size, question_of
from trueangle.simulation import Backlash, Harmonic, Latency, RunDesign, Simulation, simulate

SIM = Simulation(
    harmonics=(Harmonic("output", 1, 14.0, 240.0),),
    sigma_arcsec=1.0,
    runs=(
        RunDesign(samples=90, reversals=(0.5,)),
        RunDesign(samples=70, reversals=(0.4,), speed_deg_s=30.0),
    ),
)
RIVALS = (Hypothesis("backlash", (Backlash(1.0),)), Hypothesis("latency", (Latency(5e-5),)))


def regression(rho, sim=SIM):
    signals = join_runs(simulate(sim, 3))
    noise = np.random.default_rng(1).standard_normal(len(signals))
    return Regression.of(signals, noise, sim.surroundings, rho=rho)


def dense(signals, error, columns, rho):
    """T by the inverse of the whole covariance, run by run, and plain normal equations."""
    lag = np.abs(signals.row[:, None] - signals.row[None, :])
    same = signals.run[:, None] == signals.run[None, :]
    weight = np.linalg.inv(np.where(same, rho**lag, 0.0))
    gram = columns.T @ weight @ columns
    b = np.linalg.solve(gram, columns.T @ weight @ error)
    left = error - columns @ b
    return float(left @ weight @ left)


@pytest.mark.parametrize("rho", [0.0, 0.7])
def test_what_a_rival_leaves_is_that_of_dense_generalised_least_squares(rho):
    fitted = regression(rho)
    signals = fitted.signals
    found = {
        (e.cause, e.rival): e.deviance
        for e in evidence_between(fitted, RIVALS, ReadingNoise(1.0, rho), searched=True)
    }
    theta = signals.theta
    base = np.column_stack([np.ones_like(theta), np.cos(theta), np.sin(theta)])
    error = RIVALS[0].errors(signals, fitted.belief)[0]
    assert found["backlash", ""] == pytest.approx(dense(signals, error, base, rho), rel=1e-6)
    delay = (
        EFFECTS["latency"].propose(Regression.of(signals, error, fitted.belief, rho=rho)).columns
    )
    both = np.column_stack([base, delay])
    # The form of the delay's columns follows the pattern as fitted, within the noise.
    expected = dense(signals, error, both, rho)
    assert found["backlash", "latency"] == pytest.approx(expected, rel=1e-3)


def test_a_cause_is_looked_for_in_its_own_error_once(monkeypatch):
    searched, propose = [], Backlash.propose.__func__

    def counted(cls, regression):
        searched.append(regression)
        return propose(cls, regression)

    monkeypatch.setattr(Backlash, "propose", classmethod(counted))
    fitted, one = regression(0.3), RIVALS[0]
    assert not is_doubted(fitted, one, ())
    for _ in range(2):
        evidence_between(fitted, [one], ReadingNoise(1.0, 0.3))
    assert len(searched) == 1


def test_evidence_grows_with_the_square_of_the_size_and_falls_with_the_variance():
    fitted = regression(0.0)
    one, two = (
        evidence_between(fitted, [Hypothesis("backlash", (Backlash(b),))], ReadingNoise(1.0), False)
        for b in (1.0, 2.0)
    )
    (noisy,) = evidence_between(
        fitted, [Hypothesis("backlash", (Backlash(1.0),))], ReadingNoise(3.0), False
    )
    assert two[0].deviance == pytest.approx(4.0 * one[0].deviance, rel=1e-9)
    assert noisy.deviance == pytest.approx(one[0].deviance / 9.0, rel=1e-9)


def test_evidence_is_the_deviance_less_what_parameters_and_searches_cost():
    """A logarithm of the readings for each parameter, twice that of the places searched."""
    fitted = regression(0.0)
    defect = effect_of_size("local_defect", 3.0, fitted.signals, SIM.surroundings)
    rivals = (RIVALS[1], Hypothesis("local_defect", (defect,)))
    log_n, prices = np.log(len(fitted.signals)), {}
    for one in rivals:
        error = fitted.residual + one.errors(fitted.signals, fitted.belief)[0]
        alone = Regression.of(fitted.signals, error, fitted.belief, rho=0.0)
        found = EFFECTS[one.cause].propose(alone)
        prices[one.cause] = found.parameters * log_n + 2.0 * found.log_grid
    # One delay; a place, a width and a height among all places of a turn.
    assert prices["latency"] == pytest.approx(log_n)
    assert prices["local_defect"] > 3.0 * log_n + 2.0 * np.log(100.0)
    told = evidence_between(fitted, rivals, ReadingNoise(1.0), searched=True)
    for cause, price in prices.items():
        (none,) = [e for e in told if (e.cause, e.rival) == (cause, "")]
        assert none.deviance - none.bic == pytest.approx(price + 6.0, abs=1e-6)


def test_one_speed_leaves_nothing_between_play_and_a_delay():
    # No line, that a delay would move.
    sim = Simulation(runs=(RunDesign(samples=90, reversals=(0.5,)),))
    found = evidence_between(regression(0.0, sim), RIVALS, ReadingNoise(1.0), searched=False)
    between = [e for e in found if e.rival]
    assert max(e.deviance for e in between) < 1e-6 * max(e.deviance for e in found)
    assert max(e.chance for e in between) < 0.05


def test_the_chance_is_that_of_simulated_differences():
    """T + 2 sqrt(T) z: of a deviance between two given errors under normal noise."""
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    shape = np.linspace(-0.4, 0.4, 60)
    deviance = float(shape @ shape)
    noise = rng.standard_normal((40_000, 60))
    gaps = np.sum((noise + shape) ** 2, axis=1) - np.sum(noise**2, axis=1)
    said = ExpectedEvidence("a", "b", deviance, deviance).chance
    assert np.mean(gaps > 6.0) == pytest.approx(said, abs=4.0 * (0.25 / 40_000) ** 0.5)


@pytest.mark.parametrize("cause", ["backlash", "thermal_drift", "scale_error", "missing_order"])
def test_an_effect_has_the_size_that_is_asked_for(cause):
    rich = join_runs(
        simulate(SIM, 0, [RunDesign(reversals=(0.4,), temperature_end_C=30.0, speed_deg_s=30.0)])
    )
    effect = effect_of_size(cause, 3.0, rich, SIM.surroundings)
    error = effect.signal(rich, SIM.surroundings, np.random.default_rng(0))
    assert error.std() == pytest.approx(3.0, rel=0.03)


def test_an_effect_that_a_run_cannot_show_has_no_size():
    still = join_runs(simulate(SIM, 0, [RunDesign()]))
    assert effect_of_size("torsional_compliance", 3.0, still, SIM.surroundings) is None


def test_what_is_too_small_to_be_seen_is_not_in_question():
    """The argument's error of a line of 14 arcsec is a thousandth of an arcsec; of 1000 it is 5."""
    rich = join_runs(simulate(SIM, 0, [RunDesign(reversals=(0.4,))]))
    spot = Ambiguity(("local_defect", "argument_error"), "", "")

    def asked(around):
        return {one.cause for one in question_of(spot, rich, around, 3.0).hypotheses}

    assert asked(SIM.surroundings) == {"local_defect"}
    steep = Simulation(harmonics=(Harmonic("output", 1, 2000.0, 240.0),))
    assert asked(steep.surroundings) == {"local_defect", "argument_error"}
    alone = Ambiguity(("argument_error",), "", "")
    assert question_of(alone, rich, SIM.surroundings, 3.0).hypotheses
