"""What dropping a cause costs, against the account that is fitted without it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.diagnosis.penalty import (
    NEW_CAUSE,
    deviance_lost,
    finding_groups,
    misfit_of_scatter,
    net_deviance_lost,
    penalty_of,
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
    """Its deviance less its parameters, its search and its cause."""
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


LINE, LOAD, STIFF = "missing_order", "torsional_compliance", "stiffening_compliance"


@pytest.mark.parametrize(
    ("causes", "groups"),
    [
        ([], []),
        ([LINE, LINE, LINE], [[0], [1], [2]]),
        (["missed_counts", LINE, "missed_counts"], [[0, 2], [1]]),
        (["local_defect", "backlash", "local_defect", "backlash"], [[0], [1, 3], [2]]),
        (["joint_coupling", "joint_coupling", LOAD], [[0], [1], [2]]),
        ([STIFF, STIFF, LINE], [[0, 1], [2]]),
    ],
)
def test_every_finding_costs_one_cause(causes: list[str], groups: list[list[int]]) -> None:
    terms = [SimpleNamespace(cause=cause, log_grid=2.0) for cause in causes]
    assert finding_groups(terms) == groups
    assert penalty_of(terms) == NEW_CAUSE * len(groups)
    # A line of a declared shaft was expected.
    declared = [*terms, SimpleNamespace(cause=LINE, log_grid=0.0)]
    assert penalty_of(declared) == penalty_of(terms)


def test_only_causes_with_a_form_may_leave_a_part_of_what_they_explain() -> None:
    """Play and a lost count, by the scatter that each takes away."""
    sim = Simulation(runs=2 * (RunDesign(samples=300, reversals=(0.4,)),))
    signals = join_runs(simulate(sim, SEED))
    error = np.random.default_rng(SEED).normal(size=len(signals)) + 20.0 * signals.direction
    error += 30.0 * ((signals.run == 1) & (signals.row >= 100))
    start = Regression.of(signals, error, sim.surroundings, rho=0.0)
    shape = {"run": 1, "row": 100}
    columns = EFFECTS["missed_counts"].columns(signals, start.around, shape)
    step = start.propose("missed_counts", shape, columns)
    play = EFFECTS["backlash"].propose(start)
    counts, backlash, both = (start.with_terms(t, 0.0) for t in ([step], [play], [step, play]))
    for without, chosen in ((start, backlash), (counts, both)):
        ratio = np.var(without.left_within_runs) / np.var(chosen.left_within_runs)
        assert ratio > 1.1
        wanted = start.n * np.log1p(1e-3 * (ratio - 1.0))
        assert misfit_of_scatter(start, chosen) == pytest.approx(wanted)
    assert misfit_of_scatter(start, counts) == 0.0
    # What scatters no less left nothing.
    assert misfit_of_scatter(backlash, start) == 0.0
    assert misfit_of_scatter(
        start, Regression.of(signals, 0.8 * error, sim.surroundings, rho=0.0)
    ) == pytest.approx(start.n * np.log1p(1e-3 * (0.8**-2 - 1.0)))
