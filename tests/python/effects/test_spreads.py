"""Spreads of zeros and of drifts, shares of rounding: what is hidden, and how well it is known."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs

from .test_stated_errors import SIM

SEEDS = range(71_200, 71_220)
RUNS = 12

#: Arcsec: not one, whose root and square are itself.
NOISE = 2.0


def readings(count: int = RUNS) -> Signals:
    """Runs of one length in time: a drift of so much a second ends alike in all of them."""
    runs = [
        replace(SIM.runs[k % 8], label=f"run {k}", samples=60, speed_deg_s=15.0)
        for k in range(count)
    ]
    return join_runs(ta.simulate(replace(SIM, runs=tuple(runs)), 3))


@pytest.fixture(scope="module")
def signals():
    return readings()


#: The effect, the figure that is its size, and what a run adds to the count of free ones.
SPREADS = {
    "zero_slip": ({"standard_deviation_arcsec": 4.0}, "standard_deviation_arcsec", RUNS - 1),
    "drift_within_run": ({"arcsec_per_s": 0.3}, "arcsec_per_s", RUNS),
}


@pytest.mark.parametrize("cause", SPREADS)
def test_a_spread_of_runs_is_told_as_the_runs_tell_it(cause, signals):
    """Sizes of seeds are centred on what is hidden and scatter as each says."""
    given, name, free = SPREADS[cause]
    print(f"seeds {SEEDS}")
    sizes, errors = [], []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        noise = NOISE * rng.standard_normal(len(signals))
        error = EFFECTS[cause](**given).signal(signals, SIM.surroundings, rng)
        start = Regression.of(signals, error + noise, SIM.surroundings, rho=0.0)
        effect = EFFECTS[cause]
        # The form that is hidden: which of ten is taken is another question.
        is_drift = cause == "drift_within_run"
        found = effect._proposal(start, "ramp") if is_drift else effect.propose(start)
        full = start.with_terms([found])
        parameters, _ = effect.report(full, [(*full.fitted()[0], full.covariance(0))])
        told = parameters[name]
        sizes.append(told.value)
        errors.append(told.std)
        # A deviation of n numbers is known to one in the root of twice as many.
        assert told.std == pytest.approx(told.value / np.sqrt(2.0 * free), rel=1e-9)
    hidden, count = given[name], len(SEEDS)
    print(cause, np.mean(sizes), np.std(sizes), np.mean(errors))
    # The root of the mean square has no bias; 4.5 errors of it.
    rms = np.sqrt(np.mean(np.square(sizes)))
    assert rms == pytest.approx(hidden, rel=4.5 / np.sqrt(2.0 * free * count) + 0.02)
    assert np.std(sizes) == pytest.approx(np.mean(errors), rel=4.5 / np.sqrt(2.0 * count))


@pytest.mark.parametrize("step", [3.0, 6.0])
def test_the_share_of_rounding_is_a_twelfth_of_the_square_of_its_step(step, signals):
    """Beside noise of one arcsec."""
    rng = np.random.default_rng(SEEDS[0])
    noise = rng.standard_normal(len(signals)) + step * rng.uniform(-0.5, 0.5, len(signals))
    start = Regression.of(replace(signals, count=step), noise, SIM.surroundings, rho=0.0)
    found = EFFECTS["quantisation"].find_scatter(start)
    share = step**2 / 12.0
    assert found.parameters["step_arcsec"].value == step
    # The variance of a thousand readings.
    near = 4.5 * np.sqrt(2.0 / len(signals))
    assert found.parameters["share_of_noise"].value == pytest.approx(
        share / (1.0 + share), rel=near
    )
