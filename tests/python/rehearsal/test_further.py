"""A plan that is rehearsed: whose noise, whose readings, how many more, and what ends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.planning import Limits
from trueangle.planning.evidence import Hypothesis, ReadingNoise
from trueangle.planning.nextruns import NextRuns, RivalEvidence
from trueangle.rehearsal import after
from trueangle.simulation import Backlash, Harmonic, Latency, RunDesign, Simulation, simulate
from trueangle.support.deadline import Deadline, current_deadline, under_deadline

STATED = Simulation(sigma_arcsec=1.0, runs=(RunDesign("old", samples=30),))
DESIGNS = (RunDesign("a", samples=20), RunDesign("b", samples=33))
PAIR = RivalEvidence(("backlash", "latency"), True, True, 12.0, 0.5)
#: Seen, unseen, and not told.
ENTRIES = (
    replace(PAIR, causes=("zero_slip",), seen=False),
    PAIR,
    replace(PAIR, causes=("scale_error", "clock_drift"), told=False),
    replace(PAIR, causes=("thermal_drift", "outliers", "latency")),
)


def planned(entries: tuple[RivalEvidence, ...] = ENTRIES, **changes: Any) -> NextRuns:
    hypotheses = tuple(tuple(Hypothesis(c, ()) for c in entry.causes) for entry in entries)
    simulation = replace(STATED, runs=DESIGNS)
    plan = NextRuns(DESIGNS, entries, False, (), 1.0, simulation, ("first",), hypotheses)
    return replace(plan, **changes)


def trials_of(seeds: int = 20, seed: int = 0, **noise: float) -> Any:
    return after._FurtherTrials((), STATED, ReadingNoise(**{"sigma": 1.0, **noise}), seeds, seed)


# -- the whole ---------------------------------------------------------------------------


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What is handed on: to the diagnosis, to its plan, and to the rehearsal of it."""
    seen: dict[str, Any] = {"plan": planned()}

    def plan(limits: Any, between: Any = None) -> NextRuns:
        seen.update(limits=limits, between=between)
        return seen["plan"]

    def diagnose(runs: Any, sim: Any, **reading: Any) -> Any:
        seen.update(asked=(runs, sim), reading=reading, within=current_deadline().within)
        return SimpleNamespace(runs=simulate(STATED, 1), plan=plan)

    def rehearsed(*given: Any) -> str:
        seen["rehearsed"] = given
        return "rehearsed"

    monkeypatch.setattr(after, "diagnose", diagnose)
    monkeypatch.setattr(after, "_rehearsed", rehearsed)
    return seen


def test_what_is_asked_for_is_handed_on(asked: dict[str, Any]) -> None:
    limits = Limits(samples=77)
    between = ["latency", "backlash", "latency"]
    found = ta.plan_after(
        "runs.csv", STATED, between=between, limits=limits, seeds=4, seed=9, within=33.0,
        period=360.0,
    )  # fmt: skip
    assert found == "rehearsed"
    assert asked["asked"] == ("runs.csv", STATED)
    assert asked["reading"] == {"period": 360.0}
    assert asked["within"] == 33.0
    assert asked["limits"] is limits
    assert asked["between"] == ["latency", "backlash"]
    plan, diagnosis, sim, *rest = asked["rehearsed"]
    assert plan is asked["plan"]
    assert (sim, rest) == (STATED, [77, 4, 9])
    ta.plan_after("runs.csv", STATED)
    assert (asked["limits"], asked["between"], asked["within"]) == (None, None, 10.0)
    # As many readings as a run of those there are may have; ten diagnoses of each, from seed 0.
    assert asked["rehearsed"][3:] == (Limits.of_runs(diagnosis.runs).samples, 10, 0)


@pytest.mark.parametrize(
    ("changes", "seeds", "rehearsed"),
    [
        ({}, 1, True),
        ({}, 0, False),
        ({"runs": ()}, 1, False),
        ({"between": (ENTRIES[0],)}, 1, False),
        ({"between": (ENTRIES[0], ENTRIES[2])}, 1, True),
        ({"between": ()}, 1, False),
    ],
)
def test_a_plan_is_rehearsed_where_something_is_seen(
    asked: dict[str, Any], changes: dict[str, Any], seeds: int, rehearsed: bool
) -> None:
    asked["plan"] = planned(**changes)
    found = ta.plan_after("runs.csv", STATED, seeds=seeds)
    assert found == ("rehearsed" if rehearsed else asked["plan"])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"between": []}, "^no causes to distinguish"),
        ({"between": ["latency", "backlsh"]}, "^between must be one of .*did you mean backlash"),
        ({"seeds": -1}, "^seeds must be a whole number from 0, got -1$"),
        ({"seed": -1, "seeds": 3}, "^seed must be a whole number from 0, got -1$"),
        ({"seeds": 2.5}, "^seeds must be a whole number from 0, got 2.5$"),
    ],
)
def test_what_cannot_be_planned_is_refused(
    asked: dict[str, Any], changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(ArgumentError, match=said):
        ta.plan_after("runs.csv", STATED, **changes)
    assert "asked" not in asked


# -- as many readings as serve -----------------------------------------------------------


def rehearsed(
    monkeypatch: pytest.MonkeyPatch,
    chance: Callable[[int, tuple[int, ...]], float | None],
    most: int,
    entries: tuple[RivalEvidence, ...] = (PAIR, PAIR),
    clock: Callable[[], float] = lambda: 0.0,
) -> tuple[NextRuns, list[tuple[int, tuple[int, ...], bool]]]:
    """The plan that is given, where each entry has a chance at so many readings; what was asked."""
    calls = []

    def counted(
        self: Any, plan: NextRuns, index: int, entry: RivalEvidence, to_the_end: bool
    ) -> RivalEvidence:
        samples = tuple(design.samples for design in plan.runs)
        calls.append((index, samples, to_the_end))
        share = chance(index, samples)
        return replace(entry, chance_named=share, trials=0 if share is None else 7)

    monkeypatch.setattr(after._FurtherTrials, "counted", counted)
    found: Any = SimpleNamespace(runs=(), noise=3.0, correlation=0.4)
    with under_deadline(Deadline(5.0, clock=clock)):
        plan = after._rehearsed(planned(entries), found, STATED, most, 20, 0)
    return plan, calls


def test_readings_grow_until_every_cause_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a half and rounded up, one entry after the other; the last count is told."""
    wanted = {0: 0.95, 1: 0.99}
    plan, calls = rehearsed(
        monkeypatch, lambda k, n: wanted[k] if k == 0 or n[0] >= 40 else 0.9, 1000
    )
    grown = [(20, 33), (30, 50), (45, 75)]
    assert calls == [(k, n, False) for n in grown for k in (0, 1)]
    assert tuple(design.samples for design in plan.runs) == grown[-1]
    assert plan.simulation.runs == plan.runs
    assert [(e.chance_named, e.trials) for e in plan.between] == [(0.95, 7), (0.99, 7)]
    assert plan.notes == ("first",)


def test_readings_grow_to_the_most_and_are_counted_to_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of runs of unlike lengths: not where one of them alone has as many as it may."""
    plan, calls = rehearsed(monkeypatch, lambda k, n: (0.0, 1.0)[k], 40)
    grown = [(20, 33), (30, 40), (40, 40)]
    assert calls == [(k, n, n == (40, 40)) for n in grown for k in (0, 1)]
    assert tuple(design.samples for design in plan.runs) == (40, 40)
    # What is named too seldom with all the readings that there may be is not told.
    assert [(e.told, e.chance_named) for e in plan.between] == [(False, 0.0), (True, 1.0)]


def test_readings_do_not_grow_once_time_is_up(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([0.0, *[9.0] * 50])
    plan, calls = rehearsed(monkeypatch, lambda k, n: 0.0, 40, clock=lambda: next(times))
    assert plan.runs == DESIGNS
    assert len(calls) == 2
    assert not any(entry.told for entry in plan.between)


@pytest.mark.parametrize("missing", [None, 0, 1])
def test_what_was_not_tried_is_noted_behind_the_notes_there_are(
    monkeypatch: pytest.MonkeyPatch, missing: int | None
) -> None:
    """Trials that were not made are no failure; what is not seen, or not told, needs none."""
    more = (replace(PAIR, seen=False), replace(PAIR, told=False))
    entries = (PAIR, PAIR, *more)
    plan, calls = rehearsed(
        monkeypatch, lambda k, n: None if k in (missing, 2, 3) else 1.0, 40, entries
    )
    assert plan.notes == (("first",) if missing is None else ("first", after.UNTRIED))
    assert plan.runs == DESIGNS
    assert len(calls) == 4


def test_trials_have_the_noise_that_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not that which is stated."""
    made = []

    def counted(self: Any, plan: Any, index: int, entry: Any, to_the_end: bool) -> Any:
        made.append((self.earlier, self.stated, self.noise, self.seeds, self.seed))
        return entry

    monkeypatch.setattr(after._FurtherTrials, "counted", counted)
    earlier = simulate(STATED, 3)
    found: Any = SimpleNamespace(runs=earlier, noise=3.0, correlation=0.4)
    after._rehearsed(planned((PAIR,)), found, STATED, 100, 6, 11)
    assert made == [(earlier, STATED, ReadingNoise(3.0, 0.4), 6, 11)]


# -- counting ----------------------------------------------------------------------------


def test_only_what_is_seen_and_told_is_counted_each_with_numbers_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No two trials draw alike: of another entry, cause or number, or from another seed."""
    drawn: dict[tuple[int, str, str], list[float]] = {}
    plan = planned()

    def names(self: Any, plan: Any, what: Hypothesis, rng: np.random.Generator) -> bool:
        drawn.setdefault((self.seed, *key, what.cause), []).append(rng.random())
        return True

    monkeypatch.setattr(after._FurtherTrials, "names", names)
    for seed in (0, 1):
        for k, entry in enumerate(ENTRIES):
            key = (str(k),)
            found = trials_of(5, seed).counted(plan, k, entry, True)
            counted = k in (1, 3)
            assert found == (
                replace(entry, chance_named=1.0, trials=5 * len(entry.causes)) if counted else entry
            )
    assert [*drawn] == [
        (seed, k, cause) for seed in (0, 1) for k in ("1", "3") for cause in ENTRIES[int(k)].causes
    ]
    values = [value for each in drawn.values() for value in each]
    assert len(set(values)) == len(values) == 50


def test_a_count_ends_early_only_where_one_more_is_missed_than_may_be(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One of forty twice is as wanted, the third is not; trials of causes before are told, too."""
    answers = [True] * 40 + [False, True, False, True, False] + [True] * 99
    monkeypatch.setattr(after._FurtherTrials, "names", lambda *_: answers.pop(0))
    entry = replace(ENTRIES[3], chance_named=0.5)
    found = trials_of(40).counted(planned(), 3, entry, False)
    assert (found.chance_named, found.trials) == (2 / 5, 45)


def test_nothing_is_counted_once_time_is_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a cause those that were made; nothing where one was not tried at all."""
    now = [0.0]

    def names(self: Any, plan: Any, what: Any, rng: Any) -> bool:
        now[0] += 1.0
        return now[0] != 2.0

    monkeypatch.setattr(after._FurtherTrials, "names", names)
    with under_deadline(Deadline(4.0, clock=lambda: now[0])):
        found = trials_of(9).counted(planned(), 3, ENTRIES[3], True)
    # The chance is that of the evidence: it was not counted of all of them.
    assert (found.chance_named, found.trials, now[0]) == (0.5, 0, 4.0)
    now[0] = 0.0
    with under_deadline(Deadline(30.0, clock=lambda: now[0])):
        found = trials_of(12).counted(planned(), 3, ENTRIES[3], True)
    # Eleven of twelve, twelve of twelve, and six of six.
    assert (found.chance_named, found.trials) == (11 / 12, 30)


# -- one trial ---------------------------------------------------------------------------


@pytest.mark.parametrize("alone", [False, True])
def test_a_trial_measures_all_runs_anew_with_what_is_hidden(
    monkeypatch: pytest.MonkeyPatch, alone: bool
) -> None:
    """In the earlier runs and the planned ones, with the noise found, against what is stated."""
    earlier = simulate(STATED, 3)
    believed = replace(STATED, harmonics=(Harmonic("output", 1, 400.0, 0.0),), runs=DESIGNS)
    plan = planned(alone=alone, simulation=believed.with_effects([Latency(1e-3)]))
    monkeypatch.setattr(
        after, "trial_outcome", lambda found, cause: SimpleNamespace(is_named=cause)
    )
    seen: list[Any] = []

    def diagnose(runs: Any, sim: Any) -> Any:
        seen.extend((runs, sim))
        return SimpleNamespace(complete=True)

    monkeypatch.setattr(after, "diagnose", diagnose)
    trial = after._FurtherTrials(earlier, STATED, ReadingNoise(0.25, 0.0), 5, 0)
    hidden = Hypothesis("backlash", (Backlash(90.0),))
    assert trial.names(plan, hidden, np.random.default_rng(4)) == "backlash"
    runs, sim = seen
    assert sim == STATED
    assert [len(run) for run in runs] == ([] if alone else [30]) + [20, 33]
    for run in runs:
        arcsec = run.error * 1_296_000.0 / run.period
        line = 400.0 * np.sin(np.radians(np.asarray(run.reference) * 360.0 / run.period))
        late = 1e-3 * np.asarray(run.velocity) * 1_296_000.0 / run.period
        left = arcsec - line - 90.0 * np.asarray(run.direction) + late
        assert 0.1 < np.std(left) < 0.5


@pytest.mark.parametrize(("within", "left"), [(None, None), (10.0, 7.0), (3.0, 1e-3)])
def test_a_trial_has_the_time_that_is_left_and_tells_that_it_was_stopped(
    monkeypatch: pytest.MonkeyPatch, within: float | None, left: float | None
) -> None:
    now, stops = [0.0], [False]
    found = []

    def diagnose(runs: Any, sim: Any) -> Any:
        found.append(current_deadline().within)
        current_deadline().stopped = stops[0]
        return SimpleNamespace(complete=False)

    monkeypatch.setattr(after, "diagnose", diagnose)
    with under_deadline(Deadline(within, clock=lambda: now[0])) as at:
        now[0] = 3.0
        for stop in (False, True, False):
            stops[0] = stop
            before = at.stopped
            hidden = Hypothesis("backlash", (Backlash(9.0),))
            assert trials_of().names(planned(), hidden, np.random.default_rng(4)) is None
            assert at.stopped == (before or stop)
    assert found == [left] * 3
