"""What dropping a cause costs, against the account that is fitted without it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.diagnosis.penalty import (
    NEW_CAUSE,
    deviance_lost,
    deviance_of_form_errors,
    finding_groups,
    form_misfit,
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


LINE, LOAD, STIFF = "missing_order", "torsional_compliance", "stiffening_compliance"


@pytest.mark.parametrize(
    ("causes", "groups", "further"),
    [
        ([], [], 0),
        ([LINE, LINE, LINE], [[0], [1], [2]], 0),
        (["missed_counts", LINE, "missed_counts"], [[0, 2], [1]], 0),
        (["local_defect", "backlash", "local_defect", "backlash"], [[0], [1, 3], [2]], 0),
        (["joint_coupling", "joint_coupling", LOAD], [[0], [1], [2]], 0),
        ([STIFF, STIFF, LINE], [[0, 1], [2]], 1),  # its own form, and that of the spring it holds
    ],
)
def test_every_finding_costs_one_cause_and_every_further_form_what_forms_leave(
    causes: list[str], groups: list[list[int]], further: int
) -> None:
    terms = [SimpleNamespace(cause=cause, log_grid=2.0) for cause in causes]
    assert finding_groups(terms) == groups
    assert penalty_of(terms, 0.0) == NEW_CAUSE * len(groups)
    forms = max(len(groups) + further - 1, 0)
    assert penalty_of(terms, 7.0) == NEW_CAUSE * len(groups) + 7.0 * forms
    # A line of a declared shaft was expected.
    declared = [*terms, SimpleNamespace(cause=LINE, log_grid=0.0)]
    assert penalty_of(declared, 7.0) == penalty_of(terms, 7.0)


@pytest.mark.parametrize("n", [50, 4000])
def test_a_form_may_leave_a_thousandth_of_the_energy(n: int) -> None:
    for energy in (1e-4, 1.0, 1e4):
        deviance = n * np.log1p(energy)
        assert deviance_of_form_errors(deviance, n) == pytest.approx(n * np.log1p(1e-3 * energy))
    assert deviance_of_form_errors(-3.0, n) == 0.0
    # Nothing of it overflows.
    assert deviance_of_form_errors(1e9 * n, n) == pytest.approx(n * (500.0 + np.log(1e-3)))


def test_only_causes_with_a_form_may_leave_a_part_of_what_they_explain() -> None:
    """Play and a lost count, by the fits without either and the scatter that each takes away."""
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
    assert form_misfit(start) == form_misfit(counts) == 0.0
    for without, chosen in ((start, backlash), (counts, both)):
        saved = without.deviance - chosen.deviance
        assert form_misfit(chosen) == pytest.approx(deviance_of_form_errors(saved, start.n))
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
