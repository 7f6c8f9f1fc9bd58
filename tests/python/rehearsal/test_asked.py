"""What a rehearsal asks: of which causes, in which order, by whom, and for how long."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.errors import ArgumentError
from trueangle.planning.evidence import ReadingNoise
from trueangle.planning.nextruns import NextRuns, RivalEvidence
from trueangle.rehearsal.detection import SizeRange
from trueangle.rehearsal.rehearse import FORMS, rehearse
from trueangle.rehearsal.trial import FAILED, NAMED, NOTHING, Trial, TrialOutcome
from trueangle.simulation import RunDesign, Simulation
from trueangle.support.deadline import Deadline, current_deadline

#: The module, whose name is its function's in the package.
room = importlib.import_module("trueangle.rehearsal.rehearse")

SIM = Simulation(sigma_arcsec=2.5, runs=tuple(RunDesign(f"{n}", samples=n) for n in (20, 31, 44)))
SIZES = SizeRange(3.0, -16, 20, True)


class Asked:
    """Stands for what answers trials, and remembers how it was made and that it was closed."""

    def __init__(self, kind: str, made: list[Any], answer: TrialOutcome) -> None:
        self.kind, self.made, self.answer = kind, made, answer
        self.ready: list[Trial] = []

    def __call__(self, *given: Any) -> Asked:
        self.made.append((self.kind, given[1:] if self.kind == "workers" else given[2:]))
        return self

    def add(self, trial: Trial) -> None:
        self.ready.append(trial)

    def answers(self) -> Iterator[tuple[Trial, TrialOutcome]]:
        while self.ready and not current_deadline().over:
            trial = self.ready.pop(0)
            self.made.append(trial)
            yield trial, self.answer

    def close(self) -> None:
        self.made.append("closed")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A rehearsal whose sizes, blind spots, further runs and answers are given."""
    seen: dict[str, Any] = {
        "made": [], "sized": [], "shown": [], "blind": {}, "hidden": set(),
        "answer": TrialOutcome(NAMED),
    }  # fmt: skip

    def sized(sim: Simulation, signals: Any, cause: str, seed: int) -> SizeRange | None:
        seen["sized"].append((cause, seed))
        return None if cause in seen["hidden"] else SIZES

    def further(signals: Any, sim: Any, spots: Any, noise: Any) -> Any:
        seen["further"] = (list(spots), noise, len(signals), current_deadline()._share)
        return SimpleNamespace(runs=(), between=())

    def shown(self: Any, stage: str, done: int, total: int, **more: Any) -> None:
        seen["shown"].append((stage, done, total, more.get("bound")))

    monkeypatch.setattr(room, "size_range", sized)
    monkeypatch.setattr(room, "blind_causes", lambda sim, signals: seen["blind"])
    monkeypatch.setattr(room, "next_runs", further)
    monkeypatch.setattr(Deadline, "at", shown)
    monkeypatch.setattr(room, "usable_cores", lambda: 3)
    for kind, name in (("local", "LocalTrials"), ("workers", "Workers")):
        monkeypatch.setattr(
            room, name, lambda *a, kind=kind: Asked(kind, seen["made"], seen["answer"])(*a)
        )
    return seen


def test_trials_of_every_cause_are_made_and_counted(asked: dict[str, Any]) -> None:
    """Each cause once, in the order in which they were named."""
    found = rehearse(SIM, causes=["latency", "backlash", "latency"], seeds=5, seed=9, workers=8)
    assert [cause.cause for cause in found.causes] == ["latency", "backlash"]
    assert asked["sized"] == [("latency", 9), ("backlash", 9)]
    # Two of each to begin with: no more processes than there are trials.
    assert asked["made"][0] == ("workers", (9, 4))
    assert asked["made"][-1] == "closed"
    made = asked["made"][1:-1]
    for cause in ("latency", "backlash"):
        numbers = [trial.number for trial in made if trial.cause == cause]
        assert sorted(numbers) == [0, 1, 2, 3, 4]
    assert (found.readings, found.runs, found.noise) == (95, 3, 2.5)
    assert (found.seed, found.seeds, found.trials, found.complete) == (9, 5, 10, True)
    assert found.notes == [FORMS]
    assert found.next_runs is None
    assert "further" not in asked
    assert asked["shown"][:2] == [("sizing effects", 0, 2, None), ("sizing effects", 1, 2, None)]
    diagnoses = [(done, total) for stage, done, total, _ in asked["shown"][2:]]
    assert diagnoses == [(made, 10) for made in range(11)]
    assert {(stage, bound) for stage, _, _, bound in asked["shown"][2:]} == {
        ("diagnoses", "at most")
    }


@pytest.mark.parametrize(
    ("workers", "seeds", "made"),
    [
        (None, 9, ("workers", (0, 2))),
        (1, 9, ("local", (0,))),
        (2, 1, ("local", (0,))),  # one trial needs no other process
        (2, 2, ("workers", (0, 2))),
    ],
)
def test_processes_are_as_many_as_are_of_use(
    asked: dict[str, Any], workers: int | None, seeds: int, made: tuple[str, Any]
) -> None:
    rehearse(SIM, causes=["backlash"], seeds=seeds, workers=workers)
    assert asked["made"][0] == made


def test_every_core_is_used_where_nothing_is_said(asked: dict[str, Any]) -> None:
    """And all causes are hidden, in 20 trials each, from seed 0, for any time."""
    shown = {"backlash", "latency"}
    asked["hidden"] = set(EFFECTS) - shown
    found = rehearse(SIM)
    assert asked["made"][0] == ("workers", (0, 3))
    assert [cause.cause for cause in found.causes] == list(EFFECTS)
    assert {cause.cause: cause.trials for cause in found.causes if cause.trials} == dict.fromkeys(
        shown, 20
    )
    assert (found.seed, found.seeds, found.complete) == (0, 20, True)


def test_what_is_given_up_is_not_waited_for(asked: dict[str, Any]) -> None:
    """A cause that is never named ends at its largest size, before all of its trials."""
    asked["answer"] = TrialOutcome(NOTHING)
    found = rehearse(SIM, causes=["backlash", "latency"], seeds=50, workers=1)
    # Steps 0, 8, 16 and 20, the last four times.
    assert [cause.trials for cause in found.causes] == [10, 10]
    totals = [total for stage, _, total, _ in asked["shown"] if stage == "diagnoses"]
    assert totals[0] == 100
    assert totals[-1] == 20
    assert set(totals) == {100, 60, 20}


def test_runs_are_asked_for_what_is_blind_in_groups(asked: dict[str, Any]) -> None:
    """Causes with one reason are one question; those that show are none of it."""
    pair = Ambiguity(("backlash", "latency", "scale_error"), "one way", "turn back")
    asked["blind"] = {"backlash": pair, "latency": pair, "clock_drift": Ambiguity(
        ("clock_drift",), "no time", "record it")}  # fmt: skip
    asked["hidden"] = {"thermal_drift", "clock_drift"}
    asked["answer"] = TrialOutcome(NOTHING)
    names = ["backlash", "thermal_drift", "scale_error", "latency", "clock_drift"]
    found = rehearse(SIM, causes=names, seeds=2, workers=1)
    spots, noise, count, share = asked["further"]
    assert [spot.causes for spot in spots] == [
        ("backlash", "latency"), ("thermal_drift",), ("clock_drift",)
    ]  # fmt: skip
    assert [spot.because for spot in spots] == ["one way", "", "no time"]
    assert noise == ReadingNoise(2.5)
    assert count == 95
    assert share == 0.2
    assert found.next_runs is None
    assert found["backlash"].blind_because == "one way"
    assert found["backlash"].measure == "turn back"
    assert found["clock_drift"].blind_because == "no time"
    assert found["clock_drift"].trials == 0
    # What the design cannot tell is tried large: at step 16 of 20.
    assert [*found["latency"].tried] == [3.0 * 2.0**4]
    assert [*found["scale_error"].tried] == [3.0]
    said = "these runs do not show it, at any size"
    assert found["thermal_drift"].blind_because == said
    assert found["thermal_drift"].measure == (EFFECTS["thermal_drift"].measure or None)


@pytest.mark.parametrize("runs", [(), (RunDesign("more", samples=9),)])
def test_runs_that_were_found_are_told_with_what_they_tell(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch, runs: tuple[RunDesign, ...]
) -> None:
    asked["hidden"] = {"thermal_drift"}
    evidence = RivalEvidence(("thermal_drift",), True, True, 12.0, 0.5)
    found = NextRuns(runs, (evidence,), False, (), 1.0, SIM)
    monkeypatch.setattr(room, "next_runs", lambda *given: found)
    told = rehearse(SIM, causes=["thermal_drift"], seeds=2).next_runs
    assert told == (found if runs else None)


def test_a_rehearsal_is_whole_where_all_of_its_causes_are(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two causes the trials of one alone are answered before the time is up."""

    def answers(self: Asked) -> Iterator[tuple[Trial, TrialOutcome]]:
        while trials := [trial for trial in self.ready if trial.cause == "latency"]:
            self.ready.remove(trials[0])
            yield trials[0], self.answer

    monkeypatch.setattr(Asked, "answers", answers)
    found = rehearse(SIM, causes=["latency", "backlash"], seeds=3, within=70.0)
    assert (found["latency"].trials, found["backlash"].trials) == (3, 0)
    assert not found.complete
    assert found.notes == [
        "INCOMPLETE: the time given, 70 s, was over before all trials of 1 cause were made; "
        "not tried at all: backlash",
        FORMS,
    ]


def test_where_nothing_is_to_be_tried_nobody_is_asked(asked: dict[str, Any]) -> None:
    asked["hidden"] = {"thermal_drift"}
    found = rehearse(SIM, causes=["thermal_drift"], seeds=2)
    assert asked["made"] == []
    assert found.complete
    assert found.trials == 0


def test_a_failure_is_noted_and_those_who_answer_are_ended(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked["answer"] = TrialOutcome(FAILED, failure="KeyError: x")
    found = rehearse(SIM, causes=["backlash"], seeds=3, workers=1)
    assert len(found.notes) == 2
    assert found.notes[0].startswith("3 diagnoses failed (KeyError: x)")
    assert found.notes[1] == FORMS

    def broken(self: Any) -> Any:
        raise ZeroDivisionError

    monkeypatch.setattr(Asked, "answers", broken)
    asked["made"].clear()
    with pytest.raises(ZeroDivisionError):
        rehearse(SIM, causes=["backlash"], seeds=3, workers=1)
    assert asked["made"][-1] == "closed"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"causes": ["latency", "backlsh"]}, "^causes must be one of .*did you mean backlash"),
        ({"causes": []}, "^no cause to hide: name one"),
        ({"seeds": 0}, "^seeds must be a whole number from 1, got 0$"),
        ({"seeds": 2.5}, "^seeds must be a whole number from 1, got 2.5$"),
        ({"seed": -1}, "^seed must be a whole number from 0, got -1$"),
        ({"workers": 0}, "^workers must be a whole number from 1, got 0$"),
        ({"within": 0.0}, "above zero"),
        ({"progress": "loud"}, "progress must be one of"),
    ],
)
def test_what_cannot_be_rehearsed_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        rehearse(SIM, **changes)


def test_a_simulation_needs_runs_and_noise() -> None:
    with pytest.raises(ArgumentError, match=r"^the simulation designs no run: add a \[\[run\]\]"):
        rehearse(replace(SIM, runs=()))
    with pytest.raises(ArgumentError, match=r"^the simulation has no noise: .* sigma_arcsec"):
        rehearse(replace(SIM, sigma_arcsec=0.0))
