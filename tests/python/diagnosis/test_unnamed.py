"""A pattern that follows something else: found alike whichever way its waves point."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.unnamed import UnnamedPattern
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import RunDesign, Simulation

SEED = 12
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(RunDesign(samples=300, start_deg=40.0 * k, reversals=(0.3, 0.7)) for k in range(4)),
)


@pytest.mark.parametrize("phase", [0.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("order", [5.0, 11.0])
def test_a_line_by_direction_is_proposed_at_any_phase(order: float, phase: float) -> None:
    """What it saves is the square of its sums over the variance: its columns fitted at once."""
    print("seed", SEED)
    signals = join_runs(ta.simulate(SIM, SEED))
    line = 20.0 * np.cos(order * signals.theta - np.radians(phase)) * signals.direction
    noise = np.random.default_rng(SEED).normal(size=len(signals))
    start = Regression.of(signals, line + noise, SIM.surroundings, rho=0.0)
    found = UnnamedPattern.propose(start)
    assert found is not None
    assert (found.shape["by"], found.shape["orders"]) == ("direction", [order])
    term, coefficients = start.with_terms([found]).fitted()[0]
    drawn = term.columns @ coefficients
    assert np.abs(drawn - line).max() < 1.0
