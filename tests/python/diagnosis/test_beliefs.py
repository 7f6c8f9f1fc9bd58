"""What a simulation claims and the joint does otherwise: at another place, or twice as strong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm

import trueangle as ta
from trueangle.diagnosis.beliefs import CLOSE, LEVEL, judge_line, verdict_of_factor
from trueangle.diagnosis.gain import measure_belief_gains
from trueangle.diagnosis.judgedbeliefs import judged_beliefs
from trueangle.effects import Backlash, LocalDefect
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 14.0, 243.0), Harmonic("motor", 1, 12.0, 46.0))
RUNS = tuple(
    RunDesign(samples=700, reversals=(0.5,), turns=2.0, speed_deg_s=v, start_deg=20.0 * k)
    for k, v in enumerate((5.0, 30.0, 5.0, 30.0))
)
SIGMA = 1.0


def judged(truth: Simulation, believed: Simulation, seed: int) -> ta.Diagnosis:
    return ta.diagnose(simulate(truth, seed, RUNS), believed)


def test_a_line_of_another_order_is_at_a_wrong_place():
    truth = Simulation(JOINT, (*LINES, Harmonic("motor", 3, 8.0, 100.0)), (), SIGMA, RUNS)
    believed = replace(truth, harmonics=(*LINES, Harmonic("motor", 2, 8.0, 60.0)))
    result = judged(truth, believed, 3)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("motor order 2", "wrong_place")
    assert (wrong.believed["order"], wrong.measured["order"]) == (2.0, 3.0)
    assert wrong.measured["amplitude_arcsec"] == pytest.approx(8.0, abs=0.3)
    assert wrong.gain.interval[0] > 0.0
    assert result.findings == []
    assert "wrong place" in result.summary()
    (effect,) = result.extended.effects
    assert (effect.shaft, effect.order) == ("motor", 3)
    assert all((h.shaft, h.order) != ("motor", 2) for h in result.extended.harmonics)


def test_a_line_of_another_size_and_order_is_absent_and_another_is_missing():
    truth = Simulation(JOINT, (*LINES, Harmonic("motor", 3, 3.0, 100.0)), (), SIGMA, RUNS)
    believed = replace(truth, harmonics=(*LINES, Harmonic("motor", 2, 8.0, 60.0)))
    result = judged(truth, believed, 4)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert wrong.verdict == "absent"
    assert [finding.cause for finding in result.findings] == ["missing_order"]


def test_a_defect_elsewhere_is_at_a_wrong_place():
    truth = Simulation(JOINT, LINES, (LocalDefect(200.0, 8.0, 4.0),), SIGMA, RUNS)
    believed = replace(truth, effects=(LocalDefect(110.0, 8.0, 4.0),))
    result = judged(truth, believed, 5)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("local_defect", "wrong_place")
    assert wrong.believed["place_deg"] == 110.0
    assert wrong.measured["place_deg"] == pytest.approx(200.0, abs=2.0)
    assert result.findings == []


def test_what_a_corrected_effect_gains_is_measured_on_other_runs():
    truth = Simulation(JOINT, LINES, (Backlash(3.0),), SIGMA, RUNS)
    result = judged(truth, replace(truth, effects=(Backlash(6.0),)), 6)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("backlash", "overestimated")
    # Three arcsec too much of either sign, and the noise.
    assert wrong.gain.before[0] == pytest.approx((3.0**2 + SIGMA**2) ** 0.5, rel=0.05)
    assert wrong.gain.after[0] == pytest.approx(SIGMA, rel=0.05)
    assert wrong.gain.interval[0] > 0.9
    assert wrong.to_dict()["gain"]["reducible_share"] > 0.9


@pytest.mark.parametrize("phase", [-170.0, -40.0, 5.0, 95.0])
def test_a_judged_line_has_the_errors_of_its_size_and_phase(phase):
    """By differences of size and phase in both coefficients (the delta method)."""
    old, new = Harmonic("output", 1, 9.0, phase + 33.0), Harmonic("output", 1, 7.0, phase)
    root = np.array([[0.05, 0.02], [-0.01, 0.08]])
    covariance = root @ root.T
    change = np.subtract(new.coefficients, old.coefficients)
    found = judge_line("x", old.coefficients, change, covariance)

    def told(at):
        one = judge_line("x", old.coefficients, at, covariance).measured
        return np.array([one["amplitude_arcsec"], one["phase_deg"]])

    assert told(change) == pytest.approx([7.0, phase % 360.0])
    assert found.believed["amplitude_arcsec"] == pytest.approx(9.0)
    assert found.believed["phase_deg"] == pytest.approx((phase + 33.0) % 360.0)
    steps = 1e-5 * np.eye(2)
    slopes = np.array([(told(change + step) - told(change - step)) / 2e-5 for step in steps])
    wanted = np.sqrt(np.einsum("ik,ij,jk->k", slopes, covariance, slopes))
    assert list(found.std.values()) == pytest.approx(wanted.tolist(), rel=1e-6)


@pytest.mark.parametrize(
    ("sigmas", "size", "phase", "verdict"),
    [
        (0.5, 0.0, 0.0, "absent"),
        (0.5, 1.4, 90.0, "absent"),
        (0.5, 7.0, 2.0, "overestimated"),
        (0.5, 13.0, -2.0, "underestimated"),
        (0.01, 10.0, 15.0, "wrong_phase"),
        (0.01, 7.0, 21.0, "wrong_phase"),
        (0.01, 7.0, 19.0, "overestimated"),
        # Thirty degrees are not three standard errors of such a phase.
        (1.2, 5.0, 30.0, "overestimated"),
        (0.01, 10.2, 0.0, "confirmed"),
    ],
)
def test_verdicts_on_a_line(sigmas, size, phase, verdict):
    """A line of 10 arcsec believed, wherever its phase is; errors in units of it."""
    for turned in (0.0, 71.0, 200.0):
        old = Harmonic("output", 1, 10.0, turned).coefficients
        new = Harmonic("output", 1, size, phase + turned).coefficients
        found = judge_line("x", old, np.subtract(new, old), sigmas**2 * np.eye(2))
        assert found.verdict == verdict, turned


def test_a_right_belief_is_refuted_as_seldom_as_said():
    """At the chance of 1e-4 itself: two coefficients of a line, both signs of a factor."""
    far = np.sqrt(chi2.isf(LEVEL, 2))
    for off in (0.99, 1.01):
        change = off * far * np.array([np.cos(2.0), np.sin(2.0)])
        found = judge_line("x", (0.0, 30.0), change, np.eye(2)).verdict
        assert (found == "confirmed") == (off < 1.0)
        for sign in (-1.0, 1.0):
            factor = 1.0 + sign * off * 0.05 * norm.isf(LEVEL / 2.0)
            assert (verdict_of_factor(factor, 0.05) == "confirmed") == (off < 1.0)
            near = 1.0 + sign * CLOSE * off
            assert (verdict_of_factor(near, 1e-6) == "confirmed") == (off < 1.0)
    told = {0.1: "absent", 0.3: "overestimated", 1.5: "underestimated", -0.4: "wrong_phase"}
    assert {factor: verdict_of_factor(factor, 0.01) for factor in told} == told
    assert verdict_of_factor(0.2, 0.08) == verdict_of_factor(-0.2, 0.08) == "absent"


def test_what_beliefs_are_measured_as_scatters_as_they_say():
    """Pulls of the factor of an effect and of the size and phase of a line, 150 seeds."""
    print("seed", 7100)
    runs = tuple(replace(design, samples=150) for design in RUNS)
    effect, line = Backlash(4.0), Harmonic("motor", 1, 12.0, 46.0)
    sim = Simulation(JOINT, (line,), (effect,), SIGMA, runs)
    signals = join_runs(simulate(sim, 1))
    around = sim.surroundings
    believed = sim.predict(signals)
    true = replace(line, amplitude_arcsec=9.0, phase_deg=80.0)
    other_line = replace(sim, harmonics=(true,)).predict(signals) - believed
    # Corrected by the account, nearly.
    corrected = replace(sim, effects=(Backlash(2.8),))
    other_effect = replace(sim, effects=(Backlash(2.6),)).predict(signals)
    other_effect -= corrected.predict(signals)
    size = float(np.sqrt(np.mean(effect.expected(signals, around) ** 2)))
    pulls = []
    for seed in range(150):
        noise = SIGMA * np.random.default_rng([7100, seed]).standard_normal(len(signals))
        fitted = Regression.of(signals, other_line + noise, around, rho=0.0)
        found = judged_beliefs(fitted, sim, sim, [], False)[0][0]
        assert found.verdict == "wrong_phase"
        pull = [(found.measured[name] - value) / found.std[name]
                for name, value in (("amplitude_arcsec", 9.0), ("phase_deg", 80.0))]  # fmt: skip
        fitted = Regression.of(signals, other_effect + noise, around, rho=0.0)
        found = judged_beliefs(fitted, sim, corrected, [], False)[0][1]
        assert found.verdict == "overestimated"
        factor, std = found.measured["factor"], found.std["factor"]
        assert found.measured["rms_arcsec"] == pytest.approx(abs(factor) * size)
        assert found.std["rms_arcsec"] == pytest.approx(std * size)
        assert found.believed["rms_arcsec"] == pytest.approx(size)
        pulls.append([*pull, (factor - 0.65) / std])
    pulls = np.array(pulls)
    # Five standard errors of a mean and of a deviation of 150.
    assert np.abs(pulls.mean(axis=0)).max() < 5.0 / np.sqrt(150)
    assert pulls.std(axis=0) == pytest.approx(1.0, abs=5.0 / np.sqrt(300))


def test_a_corrected_belief_gains_what_was_wrong_with_it():
    """A line and an effect at once: the energy of each difference, and noise is left.

    Of the effect as it is, not as an account measured it with an error of its own.
    """
    line, effect = Harmonic("output", 1, 14.0, 243.0), Backlash(6.0)
    sim = Simulation(JOINT, (line,), (effect,), SIGMA, RUNS)
    truth = replace(sim, harmonics=(replace(line, amplitude_arcsec=9.0),), effects=(Backlash(3.0),))
    signals, around = join_runs(simulate(sim, 1)), sim.surroundings
    errors = [e.expected(signals, around) for e in (effect, Backlash(3.0), Backlash(2.2))]
    noise = np.random.default_rng(7101).standard_normal(len(signals))
    y = truth.predict(signals) - sim.predict(signals) + noise
    fitted = Regression.of(signals, y - errors[1] + errors[0], around, rho=0.0)
    of_line, of_effect = measure_belief_gains(fitted, [slice(1, 3)], [(errors[0], errors[1])])
    nearly = Regression.of(signals, y - errors[2] + errors[0], around, rho=0.0)
    (of_nearly,) = measure_belief_gains(nearly, [], [(errors[0], errors[2])])
    wrong = Harmonic("output", 1, 5.0, 243.0).coefficients
    wrong = np.cos(signals.theta) * wrong[0] + np.sin(signals.theta) * wrong[1]
    play = errors[1] - errors[0]
    for gain, difference in ((of_line, wrong), (of_effect, play), (of_nearly, play)):
        wanted = np.hypot(np.std(difference), SIGMA)
        assert gain.before[0] == pytest.approx(wanted, rel=0.03)
        assert gain.after[0] == pytest.approx(SIGMA, rel=0.03)
        # What an account measured wrong is in its noise, which counts as not to be taken off.
        near = 0.05 if gain is not of_nearly else 0.1
        assert gain.reducible_share == pytest.approx(1.0, abs=near)
        assert gain.holdout == "whole runs (4 parts)"
        assert gain.note == ""
