"""What dropping a cause costs, against the account that is fitted without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.penalty import (
    deviance_lost,
    net_deviance_lost,
    regression_without,
    total_penalty,
)
from trueangle.effects import EFFECTS
from trueangle.effects.missing_order import MissingOrder
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import RunDesign, Simulation, simulate

SEED = 411

#: Deviances of some thousands, by two ways through a factorisation.
ROUNDING = 1e-6


@pytest.mark.parametrize("searched", [(0.0, 0.0), (0.0, 3.0), (1.5, 4.0)])
@pytest.mark.parametrize(("step", "line"), [(2.0, 0.5), (0.1, 0.05)])
def test_a_cause_is_worth_what_the_account_without_it_lacks(
    step: float, line: float, searched: tuple[float, float]
) -> None:
    """Its deviance less its parameters, its search, its cause and its form."""
    sim = Simulation(runs=2 * (RunDesign(samples=300, reversals=(0.4,)),))
    signals = join_runs(simulate(sim, SEED))
    error = np.random.default_rng(SEED).normal(size=len(signals))
    error += step * signals.direction + line * np.sin(3.0 * signals.theta)
    fitted = Regression.of(signals, error, sim.surroundings, rho=0.0)
    terms = [EFFECTS["backlash"].propose(fitted), MissingOrder.at(fitted, 3.0)]
    terms = [replace(term, log_grid=log) for term, log in zip(terms, searched, strict=True)]
    fitted = fitted.with_terms(terms, 0.0)
    for group in ([0], [1]):
        without = regression_without(fitted, group, settled=True)
        saved = without.deviance - fitted.deviance
        assert deviance_lost(fitted, group) == pytest.approx(saved, abs=ROUNDING)
        lacking = total_penalty(without) - total_penalty(fitted)
        assert net_deviance_lost(fitted, group) == pytest.approx(lacking, abs=ROUNDING)
