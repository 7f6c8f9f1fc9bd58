"""Lines among the causes that are chosen: of declared shafts, and in the place of bumps."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.diagnosis.exchange import exchanged_causes
from trueangle.diagnosis.penalty import total_penalty
from trueangle.diagnosis.selection import _with_declared_lines
from trueangle.effects import LocalDefect, MissingOrder
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.joint import DeclaredShaft
from trueangle.joint.pattern import line_sum
from trueangle.joint.signals import join_runs
from trueangle.simulation import Joint, Simulation

from .test_selection import SIM, started


def test_lines_of_declared_shafts_are_those_of_these_shafts_alone() -> None:
    signals = join_runs(ta.simulate(SIM, 3))
    joint = Joint(7.3, declared=(DeclaredShaft("intermediate", 2.6),))
    sim = Simulation(joint)
    found = _with_declared_lines(started(signals, sim=sim))
    orders = [term.shape["output_order"] for term in found.terms]
    assert orders == pytest.approx([2.6 * (k + 1) for k in range(len(orders))])
    assert len(orders) >= 2
    # They were not looked for.
    assert {term.log_grid for term in found.terms} == {0.0}
    plain = started(signals, sim=Simulation(Joint(7.3)))
    assert _with_declared_lines(plain) is plain


def bump(start: Regression) -> Extension:
    found = LocalDefect.propose(start)
    assert found is not None
    return found


@pytest.mark.parametrize("lines", [3, 5, 0])
@pytest.mark.parametrize("turns", [2.2, 1.2])
def test_lines_take_the_place_of_a_bump_that_imitates_them(lines: int, turns: float) -> None:
    """Several at once, which one by one save less than it; a bump that is one stays."""
    runs = tuple(replace(run, turns=turns, reversals=(0.5,)) for run in SIM.runs)
    signals = join_runs(ta.simulate(replace(SIM, runs=runs), 3))
    error = line_sum(signals.theta, tuple((k + 1.0, 8.0 / lines, 90.0) for k in range(lines)))
    if not lines:
        shape = {"shaft": "output", "place_deg": 200.0, "width_deg": 4.0}
        error = 9.0 * LocalDefect.columns(signals, SIM.surroundings, shape)[:, 0]
    start = started(signals, error)
    chosen = start.with_terms([bump(start)])
    found = exchanged_causes(chosen)
    if not lines:
        assert found is chosen
        return
    assert total_penalty(found) < total_penalty(chosen)
    assert {term.cause for term in found.terms} == {MissingOrder.kind}
    orders = sorted(term.shape["output_order"] for term in found.terms)
    assert orders == [k + 1.0 for k in range(lines)]
