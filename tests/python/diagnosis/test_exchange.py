"""Causes that were chosen wrongly are exchanged: for the one that acts, or for none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import exchange
from trueangle.diagnosis.exchange import exchanged_causes
from trueangle.diagnosis.penalty import total_penalty
from trueangle.diagnosis.selection import is_flexible, select_again
from trueangle.effects import EFFECTS, MissingOrder
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation

SEED = 5
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(samples=150, start_deg=40.0 * k, turns=1.2, reversals=(0.3, 0.7))
        for k in range(4)
    ),
)


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


def with_terms(signals: Signals, error: np.ndarray, causes: Sequence[str]) -> Regression:
    print(f"seed {SEED}")
    noise = np.random.default_rng(SEED).normal(size=len(signals))
    found = Regression.of(signals, noise + error, SIM.surroundings, rho=0.0)
    proposed = [EFFECTS[cause].propose(found) for cause in causes]
    assert all(term is not None for term in proposed)
    return found.with_terms([term for term in proposed if term is not None])


@pytest.mark.parametrize(
    "wrong", ["direction_dependent_pattern", "drift_within_run", "presliding_hysteresis"]
)
def test_a_wrong_cause_gives_way_to_the_one_that_acts(signals: Signals, wrong: str) -> None:
    chosen = with_terms(signals, 3.0 * signals.direction, [wrong])
    found = exchanged_causes(chosen)
    assert [term.cause for term in found.terms] == ["backlash"]
    assert total_penalty(found) < total_penalty(chosen)
    # The right one stays, as the object that it is.
    assert exchanged_causes(found) is found


def test_a_cause_of_nothing_is_left_out(signals: Signals) -> None:
    chosen = with_terms(signals, np.zeros(len(signals)), ["missing_order"])
    assert exchanged_causes(chosen).terms == ()


@pytest.mark.parametrize(("lines", "asked"), [(1, True), (2, False)])
def test_others_are_tried_in_the_place_of_two_findings_at_most(
    signals: Signals, lines: int, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of more, which are implausible together, that takes as long as the whole choice."""
    error = 3.0 * signals.direction
    for k in range(lines):
        error = error + 8.0 * np.cos((3 + 4 * k) * signals.theta)
    start = with_terms(signals, error, ["backlash"])
    chosen = start.with_terms(
        [*start.terms, *(MissingOrder.at(start, 3.0 + 4.0 * k) for k in range(lines))]
    )
    tried: list[Sequence[str]] = []

    def watched(rest: Regression, causes: Sequence[str], goal: float) -> Regression:
        tried.append(causes)
        return select_again(rest, causes, goal)

    monkeypatch.setattr(exchange, "select_again", watched)
    assert exchanged_causes(chosen) is chosen
    assert bool(tried) is asked
    # Of the specific causes all but the one in whose place they are tried.
    specific = {cause for cause, effect in EFFECTS.items() if not is_flexible(effect)}
    left_out = [specific.difference(causes) for causes in tried]
    assert sorted(left_out, key=min) == ([{"backlash"}, {"missing_order"}] if asked else [])


def test_a_drift_gives_way_to_a_cause_that_explains_more(signals: Signals) -> None:
    found = exchanged_causes(with_terms(signals, 3.0 * signals.direction, ["drift_within_run"]))
    assert [term.cause for term in found.terms] == ["backlash"]
    ramps = np.array([0.3, -0.2, 0.4, -0.5])[signals.run] * signals.clock
    chosen = with_terms(signals, ramps, ["drift_within_run"])
    assert exchanged_causes(chosen) is chosen
