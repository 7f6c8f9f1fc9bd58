"""What physics forbids is not named, whatever it would explain."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import ArgumentShift, HeteroscedasticNoise, MissedCounts, Outliers
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("motor", 2, 300.0, 30.0), Harmonic("wave_generator", 2, 300.0, 80.0))
RUNS = tuple(RunDesign(samples=600, reversals=(0.5,), start_deg=7.0 * k) for k in range(3))


def regression(extra=None, counts=0.0, sigma=1.0, seed=3):
    """Readings of a joint with an error of one's own, and what it is fitted with."""
    sim = Simulation(JOINT, LINES, sigma_arcsec=sigma, runs=RUNS)
    runs = ta.simulate(sim, seed)
    signals = join_runs(runs)
    error = np.zeros(len(signals)) if extra is None else extra(signals, sim.surroundings)
    cuts = np.cumsum([len(run) for run in runs])[:-1]
    measured = []
    for run, part in zip(runs, np.split(error, cuts), strict=True):
        indicated = run.indicated + part / 3600.0
        if counts:
            indicated = np.round(indicated * 3600.0 / counts) * counts / 3600.0
        measured.append(ta.CalibrationRun(run.reference, indicated, 360.0, time=run.time))
    signals = join_runs(measured)
    residual = 3600.0 * np.concatenate([run.error for run in measured]) - sim.predict(signals)
    return Regression.of(signals, residual, sim.surroundings)


@pytest.mark.parametrize(("coefficient", "named"), [(-1.0, True), (-2.2, False), (-0.2, False)])
def test_a_pattern_belongs_to_one_of_two_angles(coefficient, named):
    found = ArgumentShift.propose(
        regression(
            lambda signals, around: coefficient * ArgumentShift.columns(signals, around, {})[:, 0],
            sigma=0.05,
        )
    )
    assert (found is not None) == named


@pytest.mark.parametrize(("step", "named"), [(12.0, True), (4.0, False)])
def test_no_step_is_smaller_than_a_count(step, named):
    def lost(signals, around):
        return step * ((signals.run == 1) & (signals.row >= 300))

    fitted = regression(lost, counts=10.0, sigma=2.0)
    assert fitted.signals.count == pytest.approx(10.0)
    found = MissedCounts.propose(fitted)
    assert (found is not None and abs(found.coefficients[0]) > 9.0) == named


def test_bursts_are_outliers_and_what_happens_at_reversals_is_not():
    rng = np.random.default_rng(8)

    def bursts(signals, around):
        error = np.zeros(len(signals))
        for start in rng.choice(len(signals) - 8, 12, replace=False):
            error[start : start + 6] += 60.0 * rng.standard_normal(6)
        return error

    found = Outliers.find_scatter(regression(bursts))
    assert found is not None
    assert found.parameters["bursts"].value >= 8

    def at_reversals(signals, around):
        turn = np.flatnonzero(np.diff(signals.segment) & (np.diff(signals.run) == 0))
        error = np.zeros(len(signals))
        for k in turn:
            error[k - 1 : k + 3] += [0.0, 90.0, 0.0, -80.0]
        return error

    assert Outliers.find_scatter(regression(at_reversals)) is None


def test_no_cause_is_larger_than_what_the_readings_show():
    fitted = regression(sigma=1.0)
    # Beside the line of order 100 its copy a hair away: only their difference is seen.
    angle = fitted.signals.theta
    columns = np.column_stack([np.cos(100.0 * angle), np.cos(100.02 * angle)])
    copies = 300.0 * (columns[:, 1] - columns[:, 0])
    with_residual = fitted.of_readings(fitted.readings.less(copies))
    free = with_residual.propose("latency", {}, columns[:, 1:])
    shown = float(np.std(columns[:, 1:] @ free.coefficients))
    assert shown > 3.0 * float(np.std(with_residual.residual))
    assert free.deviance == 0.0


def test_noise_may_follow_the_motor():
    rng = np.random.default_rng(4)

    def uneven(signals, around):
        return rng.standard_normal(len(signals)) * np.exp(0.6 * np.cos(50.0 * signals.theta))

    found = HeteroscedasticNoise.find_scatter(regression(uneven, sigma=0.2))
    assert found is not None
    assert "cosine_50" in found.parameters
