"""Causes that change from run to run, where the zeros of the runs scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

import trueangle as ta
from trueangle.diagnosis.confirmation import chance_between_runs, scatter_chance
from trueangle.diagnosis.remainder import unexplained_remainder
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import (
    Backlash,
    CurrentCoupling,
    Joint,
    MissingOrder,
    RunDesign,
    Simulation,
    TorsionalCompliance,
    simulate,
)

#: Chance of a wrong alarm of the test of uniformity.
ALARM = 1e-3


def one_way(speeds: tuple[float, ...], samples: int = 60) -> Simulation:
    """Runs that keep to one direction and speed each."""
    runs = tuple(
        RunDesign(direction=int(np.sign(v)), speed_deg_s=abs(v), samples=samples) for v in speeds
    )
    return Simulation(sigma_arcsec=1.0, runs=runs)


def fitted(signals: Signals, error: np.ndarray) -> Regression:
    """Readings with a delay as their only cause."""
    start = Regression.of(signals, error, Simulation().surroundings, rho=0.0)
    return start.with_terms([EFFECTS["latency"].propose(start)])


def test_the_chance_is_uniform_where_zeros_alone_scatter() -> None:
    signals = join_runs(simulate(one_way((5.0, -9.0, 20.0, -14.0, 28.0, -31.0)), 3))
    found = []
    for seed in range(200):
        rng = np.random.default_rng([77, seed])
        error = 20.0 * rng.standard_normal(6)[signals.run] + rng.standard_normal(len(signals))
        found.append(scatter_chance(fitted(signals, error), [0]))
    assert kstest(found, "uniform").pvalue > ALARM, "seeds [77, 0] to [77, 199]"


@pytest.mark.parametrize("size", [0.0, 0.7])
def test_zeros_that_noise_explains_and_readings_within_runs_are_no_doubt(size: float) -> None:
    """Runs that keep to one speed without a scatter of zeros, and runs there and back with one."""
    if size:
        turning = replace(one_way((6.0,)).runs[0], reversals=(0.5,), samples=200)
        sim = Simulation(runs=(turning,) * 5)
    else:
        sim = one_way((5.0, -9.0, 20.0, -14.0))
    signals = join_runs(simulate(sim, 3))
    rng = np.random.default_rng(5)
    slips = 20.0 * size * rng.standard_normal(signals.runs)
    error = slips[signals.run] + rng.standard_normal(len(signals))
    error = error + 3600.0 * 1e-3 * signals.velocity
    regression = fitted(signals, error)
    rest = unexplained_remainder(regression, None)
    zeros = next(item for item in rest.evidence if item.test == "zeros of the runs")
    assert (zeros.p < 0.01) == (size > 0.0)
    assert chance_between_runs(regression, [0], rest) == 0.0


def test_play_and_wind_up_of_four_runs_are_not_confirmed_as_a_delay() -> None:
    """Direction, speed and torque of four runs: any two of the three laws leave nothing."""
    runs = (
        RunDesign("a", direction=1, speed_deg_s=5.0, samples=400),
        RunDesign("b", direction=-1, speed_deg_s=5.0, samples=400),
        RunDesign("c", direction=1, speed_deg_s=20.0, samples=400, torque_Nm=10.0),
        RunDesign("d", direction=-1, speed_deg_s=20.0, samples=400, torque_Nm=-10.0),
    )
    joint = Joint(gear_ratio=101.0)
    believed = Simulation(joint=joint, sigma_arcsec=2.0, runs=runs)
    line = MissingOrder("motor", 2.0, 12.0, 20.0)
    true = believed.with_effects([Backlash(6.0), TorsionalCompliance(0.8), line])
    found = ta.diagnose(simulate(true, 0), believed)
    assert {f.cause for f in found.findings if f.confirmed} == {"missing_order"}
    either = {spot.causes for spot in found.not_identifiable if spot.supported}
    assert {("backlash", "zero_slip"), ("torsional_compliance", "latency")} <= either
    # What any two of the three leave is no more than what factors without a name explain.
    assert not found.unexplained.found
    assert {factor.factor for factor in found.factors if not factor.named_by}
    alone = ta.diagnose(simulate(believed.with_effects([TorsionalCompliance(0.8)]), 1), believed)
    assert [f.cause for f in alone.findings if f.confirmed] == ["torsional_compliance"]


@pytest.mark.parametrize("currents", [(-3.0, 3.0), (-3.0, 3.0, 3.0, -3.0)])
def test_a_current_in_each_of_two_runs_may_be_their_zeros(currents):
    """Four runs tell: no zeros of their own come back with the current."""
    designs = tuple(
        RunDesign(samples=300, speed_deg_s=60.0, current_A=current) for current in currents
    )
    believed = Simulation(runs=designs)
    true = believed.with_effects([CurrentCoupling(2.5)])
    print("seed 28431")
    found = ta.diagnose(simulate(true, 28_431), believed)
    confirmed = [finding.cause for finding in found.findings if finding.confirmed]
    told = [set(spot.causes) for spot in found.not_identifiable if spot.supported]
    if len(currents) == 2:
        assert (confirmed, told) == ([], [{"current_coupling", "zero_slip"}])
    else:
        assert (confirmed, told) == (["current_coupling"], [])
