"""One trial: its own random numbers, what is hidden and what is believed, and what ends it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.rehearsal import trial as room
from trueangle.rehearsal.trial import (
    ENDED,
    FAILED,
    NOTHING,
    Trial,
    TrialOutcome,
    measured_signals,
    run_trial,
    trial_outcome,
    trial_rng,
)
from trueangle.simulation import Backlash, RunDesign, Simulation

#: Believed to have play already.
SIM = Simulation(
    sigma_arcsec=0.1,
    effects=(Backlash(40.0),),
    runs=(RunDesign("a", samples=30, reversals=(0.5,)), RunDesign("b", samples=41)),
)
SIGNALS = measured_signals(SIM)


def test_no_two_trials_have_the_same_random_numbers() -> None:
    asked = [
        (seed, cause, number)
        for seed in (0, 1, 2)
        for cause in ("backlash", "latency")
        for number in (0, 1, 2)
    ]
    assert len({trial_rng(*one).random() for one in asked}) == len(asked)
    assert trial_rng(2, "latency", 1).random() == trial_rng(2, "latency", 1).random()


def test_signals_are_of_all_runs_and_without_what_is_believed() -> None:
    assert (len(SIGNALS), SIGNALS.runs) == (71, 2)
    plain = measured_signals(replace(SIM, effects=()))
    np.testing.assert_array_equal(SIGNALS.degrees, plain.degrees)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What is diagnosed, and what a diagnosis is to say."""
    seen: dict[str, Any] = {"result": SimpleNamespace(complete=True), "raise": None}

    def diagnose(runs: Any, sim: Any) -> Any:
        seen.update(runs=runs, sim=sim)
        if seen["raise"]:
            raise seen["raise"]
        return seen["result"]

    monkeypatch.setattr(room, "diagnose", diagnose)
    monkeypatch.setattr(room, "trial_outcome", lambda result, cause: TrialOutcome(cause))
    return seen


def test_what_is_hidden_is_beside_what_is_believed(said: dict[str, Any]) -> None:
    """Of the size of the trial, in all runs; diagnosed against what is believed."""
    outcome = run_trial(SIM, SIGNALS, Trial("backlash", 3, 7.0, 0), 5)
    assert outcome == TrialOutcome("backlash")
    assert said["sim"] is SIM
    assert [len(run) for run in said["runs"]] == [30, 41]
    for run in said["runs"]:
        arcsec = np.asarray(run.error) * 1_296_000.0 / run.period
        left = arcsec - (40.0 + 7.0) * np.asarray(run.direction)
        assert 0.03 < np.std(left) < 0.3
    first = said["runs"][0].error
    run_trial(SIM, SIGNALS, Trial("backlash", 3, 7.0, 1), 5)
    assert not np.array_equal(said["runs"][0].error, first)
    run_trial(SIM, SIGNALS, Trial("backlash", 3, 7.0, 0), 5)
    np.testing.assert_array_equal(said["runs"][0].error, first)


def test_what_these_runs_cannot_have_is_not_diagnosed(said: dict[str, Any]) -> None:
    assert run_trial(SIM, SIGNALS, Trial("joint_coupling", 0, 1.0, 0), 5) == TrialOutcome(NOTHING)
    assert "runs" not in said


def test_a_diagnosis_that_failed_or_was_ended_is_told_as_such(said: dict[str, Any]) -> None:
    """A refusal of what was given is the user's to hear."""
    said["result"] = SimpleNamespace(complete=False)
    asked = Trial("backlash", 3, 7.0, 0)
    assert run_trial(SIM, SIGNALS, asked, 5) == TrialOutcome(ENDED)
    said["raise"] = KeyError("x")
    assert run_trial(SIM, SIGNALS, asked, 5) == TrialOutcome(FAILED, failure="KeyError: 'x'")
    said["raise"] = ArgumentError("no")
    with pytest.raises(ArgumentError, match="no"):
        run_trial(SIM, SIGNALS, asked, 5)


def told(**given: Any) -> Any:
    """A diagnosis that says nothing but this: of findings, beliefs and spots."""
    return SimpleNamespace(
        findings=[SimpleNamespace(cause=c, confirmed=s) for c, s in given.get("findings", ())],
        beliefs=[SimpleNamespace(what=w, verdict=v) for w, v in given.get("beliefs", ())],
        not_identifiable=[
            SimpleNamespace(causes=c, supported=s) for c, s in given.get("spots", ())
        ],
        unexplained=given.get("unexplained"),
    )


@pytest.mark.parametrize(
    ("given", "outcome"),
    [
        # Named twice, of two lines, it is one cause.
        (
            {"findings": [("latency", True), ("backlash", True), ("latency", True)]},
            TrialOutcome("named", (), ("latency",)),
        ),
        (
            {"findings": [("latency", True)], "beliefs": [("backlash", "absent")]},
            TrialOutcome("named", (), ("latency",)),
        ),
        # The second of two ambiguities has it.
        (
            {"spots": [(("latency", "outliers"), True), (("outliers", "backlash"), True)]},
            TrialOutcome("not_told_apart", ("outliers",)),
        ),
        # All that stands in its place: found, not told apart, each once; then what is refuted.
        (
            {
                "findings": [("latency", True), ("zero_slip", False)],
                "spots": [(("latency", "outliers"), True), (("scale_error", "x"), True)],
                "beliefs": [("clock_drift", "absent"), ("output order 1", "overestimated")],
            },
            TrialOutcome(
                "taken_for_another", ("latency", "outliers", "scale_error", "x", "clock_drift")
            ),
        ),
        # Each once, though two ambiguities and a belief have it: one trial counts once.
        (
            {
                "spots": [(("latency", "outliers"), True), (("outliers", "x"), True)],
                "beliefs": [("latency", "absent"), ("x", "confirmed")],
            },
            TrialOutcome("taken_for_another", ("latency", "outliers", "x")),
        ),
        # A line that is refuted is another name, though of no cause.
        ({"beliefs": [("output order 1", "absent")]}, TrialOutcome("taken_for_another")),
        ({"unexplained": None}, TrialOutcome("nothing")),
        ({"unexplained": SimpleNamespace(found=False)}, TrialOutcome("nothing")),
    ],
)
def test_a_verdict_names_all_that_stands_in_its_place(
    given: dict[str, Any], outcome: TrialOutcome
) -> None:
    assert trial_outcome(told(**given), "backlash") == outcome
