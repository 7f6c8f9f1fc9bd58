"""The words of a rehearsal: its table, what is never named, and the notes, each in its place."""

from __future__ import annotations

import dataclasses
import itertools
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

import trueangle as ta
from trueangle.planning.evidence import ReadingNoise
from trueangle.planning.nextruns import NextRuns, RivalEvidence
from trueangle.rehearsal.after import _FurtherTrials
from trueangle.rehearsal.detection import SizeRange, binomial_interval
from trueangle.rehearsal.rehearse import SizeSearch, _notes, _still
from trueangle.rehearsal.result import (
    Rehearsal,
    RehearsedCause,
    _else,
    _never,
    _size,
    rehearsed_cause,
)
from trueangle.rehearsal.trial import FAILED, NAMED, TrialOutcome, trial_outcome
from trueangle.support.layout import counted as in_words

PLAY = RehearsedCause(
    cause="backlash",
    size_name="half_width_arcsec",
    tried={1.0: (0, 4), 2.0: (3, 4), 4.0: (2, 2)},
    named_50=1.5,
    named_95=3.5,
    intervals={0.5: (1.25, 1.75), 0.95: (2.5, None)},
    told={"named": 5, "not_told_apart": 4, "nothing": 1},
    confused_with={"zero_slip": 4, "latency": 3, "clock_drift": 2, "outliers": 1},
    beside={"scale_error": 1},
)
LATE = replace(
    PLAY, cause="latency", size_name="delay_s", confused_with={}, named_95=None, intervals={}
)
#: Seen only at times, of sizes that show the more the smaller they are, of one size, and never.
NEVER = replace(
    PLAY, cause="outliers", size_name="share", tried={9.0: (0, 4), 3.0: (0, 1)}, named_50=None,
    named_95=None, intervals={}, told={"not_confirmed": 4, "nothing": 1},
)  # fmt: skip
UNTRIED = replace(NEVER, cause="clock_drift", tried={}, told={}, confused_with={})
NOTES = ["INCOMPLETE: why", "a note", "another"]


def rehearsal(*causes: RehearsedCause, **changes: Any) -> Rehearsal:
    trials = sum(cause.trials for cause in causes)
    return replace(
        Rehearsal([*causes], None, 701, 8, 1.25, 41, 20, trials, True, list(NOTES)), **changes
    )


def test_the_summary_has_what_ended_it_first_and_every_cause_where_it_belongs() -> None:
    lines = rehearsal(PLAY, NEVER, LATE, UNTRIED).summary().splitlines()
    assert lines[0] == "INCOMPLETE: why."
    assert lines[2].startswith("2 of 4 causes named in these runs. 8 runs, 701 readings")
    at = lines.index("Not named in these runs:")
    sizes = " ".join(" ".join(lines[3:at]).split())
    assert sizes.endswith(
        "the sizes tried do not bracket them: - backlash, half_width_arcsec: 1.5 (1.25 to 1.75) in "
        "50 %, 3.5 (2.5 to ?) in 95 %, of 10; else zero_slip, latency, clock_drift - latency, "
        "delay_s: 1.5 (? to ?) in 50 %, ? (2 of 2 at 4) in 95 %, of 10; else not distinguished, "
        "nothing"
    )
    told = " ".join(" ".join(lines[at:]).split())
    assert told == (
        "Not named in these runs: - outliers (hidden 5 times, up to share 3; confused with "
        "zero_slip, latency, clock_drift). - clock_drift: not tried. No further run was found that "
        "identifies another cause. Note: a note. Note: another."
    )


def test_the_summary_leaves_out_what_there_is_none_of() -> None:
    text = rehearsal(PLAY).summary()
    assert "Not named" not in text
    assert "No further run" not in text
    text = rehearsal(NEVER).summary()
    assert "Sizes from" not in text
    plan: Any = SimpleNamespace(summary=lambda: "Next: this\n  then that")
    text = rehearsal(PLAY, NEVER, next_runs=plan).summary()
    assert "No further run" not in text
    assert "\nNext: this\n  then that\n\nNote: a note." in text


def test_one_of_each_is_told_in_the_singular() -> None:
    """Of runs, readings, trials, causes and diagnoses."""
    once = replace(NEVER, tried={9.0: (0, 1)})
    found = rehearsal(once, runs=1, readings=1)
    text = " ".join(found.summary().split())
    assert "1 run, 1 reading, noise 1.25 arcsec; 1 diagnosis, at most 20 of a cause" in text
    assert "hidden 1 time, up to" in text
    assert found._brief() == "0 of 1 cause named, 1 trial"
    failed = [(0, TrialOutcome(FAILED, failure="KeyError: x"))]
    at: Any = SimpleNamespace(why="the time given, 2 s, was over")
    search = SizeSearch("a", None, None, 2, answers=failed)
    assert _notes([search], at) == [
        "INCOMPLETE: the time given, 2 s, was over before all trials of 1 cause were made",
        "1 diagnosis failed (KeyError: x) and counts as not named: this is a defect of trueangle",
    ]


def test_the_brief_counts_what_has_a_size() -> None:
    found = rehearsal(PLAY, replace(LATE, named_50=None), NEVER, LATE, complete=False)
    assert found._brief() == "2 of 4 causes named, 35 trials, incomplete"


def test_a_cause_is_found_by_its_whole_name() -> None:
    found = rehearsal(replace(PLAY, cause="zero_slip_2"), replace(PLAY, cause="zero_slip"), LATE)
    assert found["zero_slip"] is found.causes[1]
    with pytest.raises(KeyError, match="zero"):
        found["zero"]


def test_what_is_printed_holds_the_further_runs_and_every_field_of_a_cause() -> None:
    plan: Any = SimpleNamespace(to_dict=lambda: {"runs": 3})
    told = rehearsal(
        replace(PLAY, blind_because="one way", measure="turn back"), UNTRIED, next_runs=plan
    ).to_dict()
    assert told["next_run"] == {"runs": 3}
    of, untried = told["causes"]
    assert (of["cause"], of["size_name"]) == ("backlash", "half_width_arcsec")
    assert of["confused_with"] == ["zero_slip", "latency", "clock_drift", "outliers"]
    assert (of["blind_because"], of["measure"]) == ("one way", "turn back")
    assert [entry["interval"] for entry in of["tried"]] == [
        [*binomial_interval(*counts)] for counts in ((0, 4), (3, 4), (2, 2))
    ]
    assert untried["named_50_interval"] == untried["named_95_interval"] == [None, None]


@pytest.mark.parametrize(
    ("changes", "share", "said"),
    [
        # All but one of twenty are not more than 95 %, of a hundred they are.
        ({"tried": {2.0: (19, 20), 4.0: (20, 20)}}, 0.95, "? (20 of 20 at 4)"),
        ({"tried": {2.0: (99, 100), 4.0: (20, 20)}}, 0.95, "below 2"),
        ({"tried": {2.0: (18, 20), 4.0: (20, 20)}}, 0.95, "? (20 of 20 at 4)"),
        ({"tried": {9.0: (20, 20), 4.0: (1, 20)}, "grows": False}, 0.95, "above 9"),
        ({"tried": {9.0: (0, 20)}, "named_95": 3.0}, 0.95, "0 of 20"),
    ],
)
def test_a_size_that_is_not_bracketed_is_told_by_its_share(
    changes: dict[str, Any], share: float, said: str
) -> None:
    assert _size(replace(PLAY, **{"named_95": None, **changes}), share) == said


def test_what_is_never_named_says_why_and_what_would() -> None:
    told = {"blind_because": "one way", "measure": "turn back"}
    assert _never(replace(UNTRIED, **told)) == "clock_drift: one way. To find out: turn back."
    assert _else(PLAY) == "not distinguished, nothing"
    # The last size is the most visible one, though it is the least.
    assert "up to share 3;" in _never(NEVER)


# -- of one cause ------------------------------------------------------------------------


def test_trials_of_a_cause_are_put_together_in_any_order() -> None:
    sizes = SizeRange(3.0, -16, 20, False)
    nothing, named = TrialOutcome("nothing"), TrialOutcome("named")
    answers = [(4, named), (0, nothing), (4, nothing), (-4, nothing), (0, nothing), (0, named)]
    found = rehearsed_cause("x", "size", sizes, answers, "blind", "measure")
    # From the least visible on, which is the largest here; what was said most often first.
    assert [*found.tried.items()] == [(6.0, (0, 1)), (3.0, (1, 3)), (1.5, (1, 2))]
    assert [*found.told.items()] == [("nothing", 4), ("named", 2)]
    assert found.ever_named
    assert not found.grows
    assert (found.blind_because, found.measure) == (None, None)
    # Two steps beyond either side.
    ends = [found.curve[0][0], found.curve[-1][0]]
    assert ends == pytest.approx([6.0 * 2.0**0.5, 1.5 / 2.0**0.5])
    assert len(found.curve) == 60


@pytest.mark.parametrize("highest", [0, 1])
def test_a_cause_of_one_size_has_shares_and_no_thresholds(highest: int) -> None:
    """As one of which nothing was tried, or that has no sizes at all."""
    sizes = SizeRange(1.0, 0, highest, True)
    answers = [(0, TrialOutcome("named")), (0, TrialOutcome("nothing"))]
    found = rehearsed_cause("x", "size", sizes, answers, None, None)
    assert found.tried == {1.0: (1, 2)}
    assert bool(found.intervals) == bool(found.curve) == bool(highest)
    none = rehearsed_cause("x", "size", sizes, [], "blind", "measure")
    assert (none.tried, none.intervals, none.curve) == ({}, {}, ())
    assert (none.blind_because, none.measure, none.grows) == ("blind", "measure", True)
    assert rehearsed_cause("x", "size", None, [], None, None).grows


def cause(**changes) -> RehearsedCause:
    given = {
        "cause": "backlash",
        "size_name": "half_width_arcsec",
        "tried": {1.0: (0, 4), 2.0: (3, 4), 4.0: (2, 2)},
        "named_50": 1.5,
        "named_95": None,
        "intervals": {0.5: (1.25, 1.75), 0.95: (2.5, None)},
        "told": {"named": 5, "nothing": 4, "not_told_apart": 1},
        "confused_with": {"latency": 2},
        "beside": {"zero_slip": 1},
    }
    return RehearsedCause(**{**given, **changes})


@pytest.mark.parametrize(
    ("changes", "share", "said"),
    [
        ({}, 0.5, "1.5 (1.25 to 1.75)"),
        ({}, 0.95, "? (2 of 2 at 4)"),
        ({"named_95": 3.0}, 0.95, "3 (2.5 to ?)"),
        ({"tried": {7.0: (3, 5)}}, 0.5, "3 of 5"),
        ({"named_50": None, "tried": {1.0: (3, 4), 9.0: (4, 4)}}, 0.5, "below 1"),
        ({"named_50": None, "tried": {9.0: (3, 4), 1.0: (4, 4)}, "grows": False}, 0.5, "above 9"),
        ({"tried": {1.0: (3, 4), 9.0: (4, 4)}}, 0.95, "? (4 of 4 at 9)"),
        ({"named_50": None, "tried": {1.0: (2, 4), 9.0: (1, 4)}}, 0.5, "? (1 of 4 at 9)"),
    ],
)
def test_a_size_is_told_as_far_as_it_is_bracketed(changes, share, said) -> None:
    assert _size(cause(**changes), share) == said


def test_what_is_never_named_is_told_with_its_trials_and_largest_size() -> None:
    never = {"tried": {1.0: (0, 4), 8.0: (0, 3)}, "told": {"not_confirmed": 5, "nothing": 2}}
    said = _never(cause(**never, blind_because="one way", measure="turn back"))
    assert said == (
        "backlash: one way (hidden 7 times, up to half_width_arcsec 8; confused with latency). "
        "To find out: turn back."
    )
    said = _never(cause(**never, confused_with={}))
    assert said == (
        "backlash (hidden 7 times, up to half_width_arcsec 8; reported: not confirmed, nothing)."
    )
    assert _never(cause(tried={}, told={})) == "backlash: not tried."


def test_every_figure_of_a_rehearsal_has_its_own_place() -> None:
    found = Rehearsal([cause(named_95=3.0)], None, 701, 8, 1.25, 41, 20, 10, False, ["a note"])
    told = json.loads(found.to_json()) if hasattr(found, "to_json") else found.to_dict()
    names = ("readings", "runs", "noise_arcsec", "seed", "seeds", "trials", "complete", "notes")
    assert [told[n] for n in names] == [701, 8, 1.25, 41, 20, 10, False, ["a note"]]
    (of,) = told["causes"]
    assert (of["named_50"], of["named_95"], of["trials"]) == (1.5, 3.0, 10)
    assert (of["named_50_interval"], of["named_95_interval"]) == ([1.25, 1.75], [2.5, None])
    assert of["beside"] == {"zero_slip": 1}
    assert of["told"] == {"named": 5, "nothing": 4, "not_told_apart": 1}
    assert [(t["size"], t["named"], t["trials"]) for t in of["tried"]] == [
        (1.0, 0, 4), (2.0, 3, 4), (4.0, 2, 2),
    ]  # fmt: skip
    text = " ".join(found.summary().split())
    assert "8 runs, 701 readings, noise 1.25 arcsec; 10 diagnoses, at most 20 of a cause" in text
    assert "seed 41" in text


# -- counting --------------------------------------------------------------------------

ENTRY = RivalEvidence(("backlash", "latency"), True, True, 12.0, 0.5)
PLAN = SimpleNamespace(hypotheses=[("first", "second")])


def counted(monkeypatch, answers, seeds=10, to_the_end=True) -> RivalEvidence:
    """With the answers of simulated diagnoses, by what is hidden."""
    left = {name: list(given) for name, given in answers.items()}
    monkeypatch.setattr(_FurtherTrials, "names", lambda self, plan, what, rng: left[what].pop(0))
    trials = _FurtherTrials((), ta.Simulation(), ReadingNoise(1.0, 0.0), seeds, 0)
    return trials.counted(PLAN, 0, ENTRY, to_the_end)


def test_the_chance_is_the_least_of_the_causes(monkeypatch) -> None:
    answers = {"first": [True] * 9 + [False], "second": [True, False] * 5}
    found = counted(monkeypatch, answers)
    assert (found.chance_named, found.trials) == (0.5, 20)
    answers = {"first": [True, False] * 5, "second": [True] * 10}
    assert counted(monkeypatch, answers).chance_named == 0.5


def test_trials_that_were_ended_do_not_count(monkeypatch) -> None:
    answers = {"first": [True] * 10, "second": [True, False, True, True, None]}
    found = counted(monkeypatch, answers)
    assert (found.chance_named, found.trials) == (0.75, 14)
    # Nothing is said where one of the causes was never tried.
    answers = {"first": [True] * 10, "second": [None]}
    assert counted(monkeypatch, answers).trials == 0


def test_counting_ends_where_one_is_clearly_not_named(monkeypatch) -> None:
    """Two of twenty that are not are more than one in twenty."""
    answers = {"first": [True, False, False] + [True] * 17, "second": [True] * 20}
    found = counted(monkeypatch, answers, seeds=20, to_the_end=False)
    assert (found.chance_named, found.trials) == (pytest.approx(1.0 / 3.0), 3)


# -- verdicts --------------------------------------------------------------------------


def told(findings=(), beliefs=(), spots=(), unexplained=False):
    """What a diagnosis would say, as far as a verdict asks."""
    return SimpleNamespace(
        findings=[SimpleNamespace(cause=c, confirmed=sure) for c, sure in findings],
        beliefs=[SimpleNamespace(what=w, verdict=v) for w, v in beliefs],
        not_identifiable=[SimpleNamespace(causes=c, supported=s) for c, s in spots],
        unexplained=SimpleNamespace(found=unexplained),
    )


@pytest.mark.parametrize(
    ("said", "verdict", "instead", "beside"),
    [
        ({"findings": [("backlash", True), ("latency", True)]}, "named", (), ("latency",)),
        ({"beliefs": [("backlash", "overestimated")]}, "named", (), ()),
        ({"beliefs": [("backlash", "confirmed")]}, "nothing", (), ()),
        ({"findings": [("backlash", False), ("latency", True)]}, "not_confirmed", ("latency",), ()),
        ({"spots": [(("backlash", "latency"), True)]}, "not_told_apart", ("latency",), ()),
        ({"spots": [(("backlash", "latency"), False)]}, "nothing", (), ()),
        ({"findings": [("latency", True)]}, "taken_for_another", ("latency",), ()),
        ({"findings": [("latency", False)]}, "nothing", (), ()),
        ({"beliefs": [("latency", "absent")]}, "taken_for_another", ("latency",), ()),
        ({"spots": [(("latency",), True)]}, "taken_for_another", ("latency",), ()),
        ({"unexplained": True}, "unexplained", (), ()),
    ],
)
def test_a_verdict_is_of_what_is_confirmed_and_hidden(said, verdict, instead, beside) -> None:
    found = trial_outcome(told(**said), "backlash")
    assert (found.verdict, found.instead, found.beside) == (verdict, instead, beside)
    assert found.is_named == (verdict == "named")


def test_further_runs_are_for_causes_of_which_one_was_not_named() -> None:
    """Against sets written out: what is told by them has to be among what is left."""
    names = ("backlash", "latency", "zero_slip", "thermal_drift")
    pairs = [(names[:2], True), (names[1:3], False), (names[3:], True), (names[:3], True)]
    entries = tuple(RivalEvidence(causes, True, told, 8.0, 0.9) for causes, told in pairs)
    given = {"runs": (), "hypotheses": (), "simulation": None, "notes": (), "between": entries}
    fields = {field.name for field in dataclasses.fields(NextRuns)}
    plan = NextRuns(**{name: given.get(name) for name in fields})
    for named in itertools.chain.from_iterable(
        itertools.combinations(names, count) for count in range(5)
    ):
        found = [cause(cause=name, tried={1.0: (int(name in named), 2)}) for name in names]
        left = [entry for entry in entries if set(entry.causes) - set(named)]
        further = _still(plan, found)
        if any(entry.told for entry in left):
            assert further is not None
            assert list(further.between) == left, named
        else:
            assert further is None, named
    assert _still(None, found) is None


@pytest.mark.parametrize("stopped", [False, True])
def test_what_is_incomplete_is_what_has_trials_left(stopped) -> None:
    """Of causes that are done, of some trials, of none, and of none to make; and of failures."""
    why = "it was interrupted" if stopped else "the time given, 7.5 s, was over"
    at = SimpleNamespace(why=why)
    kinds = {"done": (True, 3), "some": (False, 2), "none": (False, 0), "blind": (True, 0)}
    for count in range(5):
        for chosen in itertools.combinations(kinds, count):
            searches = []
            for name in chosen:
                done, trials = kinds[name]
                answers = [(0, TrialOutcome(NAMED))] * trials
                searches.append(SizeSearch(name, None, None, 3, answers=answers, done=done))
            notes = _notes(searches, at)
            left = [name for name in chosen if name in ("some", "none")]
            assert len(notes) == bool(left)
            if left:
                wanted = (
                    f"INCOMPLETE: {why} before all trials of {in_words(left, 'cause')} were made"
                )
                more = "; not tried at all: none" if "none" in chosen else ""
                assert notes == [wanted + more]
    failed = [(0, TrialOutcome(FAILED, failure="KeyError: x")), (0, TrialOutcome(NAMED))]
    searches = [SizeSearch("a", None, None, 2, answers=failed, done=True)] * 2
    (note,) = _notes(searches, at)
    assert note.startswith("2 diagnoses failed (KeyError: x) and count as not named")
