"""One trial: its own random numbers, what is hidden and what is believed, and what ends it."""

from __future__ import annotations

from dataclasses import astuple, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.effects.drawing import Drawing
from trueangle.errors import ArgumentError
from trueangle.rehearsal import trial as room
from trueangle.rehearsal.detection import Chance, SizeRange
from trueangle.rehearsal.rehearse import SizeSearch, next_sizes
from trueangle.rehearsal.trial import (
    ENDED,
    FAILED,
    NAMED,
    NOTHING,
    Trial,
    TrialOutcome,
    drawn_effect,
    measured_signals,
    run_trial,
    trial_outcome,
    trial_rng,
)
from trueangle.simulation import Backlash, Harmonic, Joint, RunDesign, Simulation

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


DRAWS = 24
SEED = 17
DRAWN_SIM = Simulation(
    joint=Joint(gear_ratio=30.0),
    harmonics=(Harmonic("output", 1, 40.0, 20.0), Harmonic("motor", 1, 12.0, 70.0)),
    sigma_arcsec=2.0,
    runs=tuple(
        RunDesign(label=name, turns=2.0, samples=240, reversals=(0.5,), speed_deg_s=speed,
                  torque_Nm=torque, gravity_Nm=3.0, temperature_C=temperature)
        for name, speed, torque, temperature in (
            ("a", 10.0, 0.0, 20.0), ("b", 30.0, 4.0, 35.0), ("c", 20.0, -2.0, 28.0),
        )
    ),
)  # fmt: skip
DRAWN_SIGNALS = measured_signals(DRAWN_SIM)
TORQUES = float(np.ptp(DRAWN_SIGNALS.torque))

#: Of what is drawn beside the size: least and greatest.
BETWEEN = {
    ("torque_hysteresis", "span_Nm"): (0.1 * TORQUES, 0.3 * TORQUES),
    ("presliding_hysteresis", "length_deg"): (2.0, 6.0),
    ("local_defect", "width_deg"): (3.0, 8.0),
    ("local_defect", "place_deg"): (0.0, 360.0),
    ("outliers", "fraction"): (0.01, 0.03),
    ("non_integer_order", "order"): (5.3, 39.7),
    ("missed_counts", "run"): (0, 2),
    ("missed_counts", "row"): (0.2 * 240 - 1, 0.8 * 240),
    ("wrong_gear_ratio", "gear_ratio"): (29.0, 31.0),
}

#: Twice the size is no twice the error: noise, a sensor at its other angle, a lag's curve.
CURVED = {
    "argument_error",
    "backlash",
    "filter_lag",
    "heteroscedastic_noise",
    "latency",
    "outliers",
    "stiffening_compliance",
    "wrong_gear_ratio",
}


def drawn(kind, size, number):
    rng = trial_rng(SEED, kind, number)
    return drawn_effect(kind, size, Drawing(DRAWN_SIGNALS, DRAWN_SIM.surroundings, rng)), rng


@pytest.mark.parametrize("kind", list(EFFECTS))
def test_an_effect_is_drawn_within_its_ranges_and_valid(kind):
    print(f"seed {SEED}")
    found = [drawn(kind, 0.5, k)[0] for k in range(DRAWS)]
    assert len({effect is None for effect in found}) == 1
    if found[0] is None:
        return
    assert all(isinstance(effect, EFFECTS[kind]) for effect in found)
    # What cannot be is refused where it is made anew from its parts.
    assert [replace(effect) for effect in found] == found
    for (name, part), (least, most) in BETWEEN.items():
        if name == kind:
            values = [getattr(effect, part) for effect in found]
            assert least <= min(values) <= max(values) <= most
            assert min(values) < max(values)
    if kind == "non_integer_order":
        rests = np.mod([effect.order for effect in found], 1.0)
        assert 0.3 <= rests.min() <= rests.max() <= 0.7


@pytest.mark.parametrize("kind", sorted(set(EFFECTS) - CURVED))
def test_twice_the_size_is_twice_the_error(kind):
    for number in range(3):
        (one, rng), (two, again) = (drawn(kind, size, number) for size in (0.01, 0.02))
        if one is None:
            assert two is None
            return
        errors = [effect.signal(DRAWN_SIGNALS, DRAWN_SIM.surroundings, chance)
                  for effect, chance in ((one, rng), (two, again))]  # fmt: skip
        assert np.isfinite(errors).all()
        assert astuple(one) != astuple(two)
        np.testing.assert_allclose(errors[1], 2.0 * errors[0], rtol=1e-6, atol=1e-9)


def test_a_spring_that_stiffens_is_softer_by_a_quarter_at_the_largest_load():
    for size in (0.02, 0.3):
        effect, rng = drawn("stiffening_compliance", size, 0)
        error = effect.signal(DRAWN_SIGNALS, DRAWN_SIM.surroundings, rng)
        loads = np.abs(DRAWN_SIGNALS.torque)
        k = int(np.argmax(loads))
        assert abs(error[k]) == pytest.approx(0.75 * effect.arcsec_per_Nm * loads[k])
        assert effect.arcsec_per_Nm3 == -size
    # Where no load was recorded there is no error.
    bare = replace(DRAWN_SIGNALS, torque=None)
    free = EFFECTS["stiffening_compliance"].drawn(0.3, Drawing(bare, DRAWN_SIM.surroundings, rng))
    assert not free.signal(bare, DRAWN_SIM.surroundings, rng).any()


def test_what_these_runs_cannot_have_is_not_drawn():
    still = replace(DRAWN_SIM, runs=(RunDesign(label="a", turns=1.0, samples=90),))
    signals = measured_signals(still)
    rng = np.random.default_rng(SEED)
    for kind in ("torque_hysteresis", "joint_coupling"):
        assert drawn_effect(kind, 1.0, Drawing(signals, still.surroundings, rng)) is None
    bare = replace(DRAWN_SIM, harmonics=())
    assert drawn_effect("filter_lag", 1.0, Drawing(DRAWN_SIGNALS, bare.surroundings, rng)) is None


SPOT = Ambiguity(("backlash", "latency"), "one way", "turn back")


@pytest.mark.parametrize(
    ("tried", "seeds", "start", "steps"),
    [
        ({}, 20, 0, [0, 0]),
        ({}, 20, 5, [5, 5]),
        ({}, 1, 0, [0]),
        # Never named: up by eight, not beyond the highest, and there four times.
        ({0: (0, 2)}, 20, 0, [8, 8]),
        ({0: (0, 2)}, 3, 0, [8]),
        ({0: (0, 2), 8: (0, 2)}, 20, 0, [13, 13]),
        ({0: (0, 2), 13: (0, 2)}, 20, 0, [13, 13]),
        ({0: (0, 2), 13: (0, 3)}, 20, 0, [13, 13]),
        ({0: (0, 2), 13: (0, 4)}, 20, 0, []),
        ({13: (0, 3)}, 3, 0, []),
        ({0: (0, 2), 13: (0, 2)}, 4, 0, []),
        # Always named: down by six, not beyond the lowest.
        ({0: (2, 2)}, 20, 0, [-6, -6]),
        ({0: (2, 2)}, 3, 0, [-6]),
        ({-6: (2, 2), 0: (2, 2)}, 20, 0, [-9, -9]),
        ({0: (2, 2)}, 2, 0, []),
        ({0: (1, 2)}, 1, 0, []),
    ],
)
def test_sizes_are_bracketed(
    tried: dict[int, tuple[int, int]], seeds: int, start: int, steps: list[int]
) -> None:
    assert next_sizes(tried, -9, 13, seeds, start) == steps
    if start == 0:
        assert next_sizes(tried, -9, 13, seeds) == steps


@pytest.mark.parametrize(
    "tried",
    [
        {0: (0, 2), 8: (1, 2)},
        {0: (1, 2)},
        {-6: (0, 2), 0: (2, 2), 8: (3, 4)},
        {-9: (2, 2), 0: (2, 2)},
        {0: (0, 10), 8: (6, 10), 13: (6, 10)},
    ],
)
@pytest.mark.parametrize("left", [1, 3, 9])
def test_later_sizes_are_where_the_chance_is_aimed_at(
    tried: dict[int, tuple[int, int]], left: int
) -> None:
    """At 30, 75 and twice at 95 %, by medians; the highest where it is never so great."""
    made = sum(count for _, count in tried.values())
    wanted = []
    for aim in (0.3, 0.75, 0.95, 0.95):
        step = Chance(tried).quantile(aim, 0.5)
        wanted.append(13 if step == np.inf else min(max(round(step), -9), 13))
    assert next_sizes(tried, -9, 13, made + left) == wanted[:left]


def test_a_search_goes_by_rounds_whoever_answers_first() -> None:
    """Each trial has the next number, and the size of its step; a round counts when it is whole."""
    search = SizeSearch.of("backlash", SizeRange(3.0, -9, 13, True), None, 6)
    assert (search.is_blind, search.done) == (False, False)
    first = search.next_round()
    assert first == [Trial("backlash", 0, 3.0, 0), Trial("backlash", 0, 3.0, 1)]
    assert search.answered(first[1], TrialOutcome(NOTHING)) == []
    assert search.answers == []
    second = search.answered(first[0], TrialOutcome(NOTHING, ("latency",)))
    assert second == [Trial("backlash", 8, 12.0, 2), Trial("backlash", 8, 12.0, 3)]
    assert search.answers == [
        (0, TrialOutcome(NOTHING, ("latency",))), (0, TrialOutcome(NOTHING))
    ]  # fmt: skip
    assert search.answered(second[0], TrialOutcome(NOTHING)) == []
    third = search.answered(second[1], TrialOutcome(NAMED))
    assert [trial.number for trial in third] == [4, 5]
    assert [trial.size for trial in third] == [3.0 * 2.0 ** (t.step / 4.0) for t in third]
    assert not search.done
    assert search.answered(third[0], TrialOutcome(NAMED)) == []
    assert search.result().trials == 4  # the round that was not finished does not count
    assert search.answered(third[1], TrialOutcome(NAMED)) == []
    assert search.done
    found = search.result()
    assert (found.cause, found.size_name, found.trials) == ("backlash", "half_width_arcsec", 6)
    assert (found.blind_because, found.measure) == (None, None)


@pytest.mark.parametrize(("highest", "top"), [(20, 16), (16, 16), (11, 11), (0, 0)])
@pytest.mark.parametrize("grows", [True, False])
def test_what_the_design_cannot_tell_is_tried_large(highest: int, top: int, grows: bool) -> None:
    search = SizeSearch.of("latency", SizeRange(3.0, -9, highest, grows), SPOT, 20)
    assert search.is_blind
    size = 3.0 * 2.0 ** ((top if grows else -top) / 4.0)
    rounds = search.next_round()
    assert rounds == [Trial("latency", top, size, 0), Trial("latency", top, size, 1)]
    (*_, last), more = rounds, []
    search.answered(rounds[0], TrialOutcome(NOTHING))
    more = search.answered(last, TrialOutcome(NOTHING))
    for trial in more:
        rest = search.answered(trial, TrialOutcome(NOTHING))
    assert (rest, search.done) == ([], True)
    found = search.result()
    assert (found.blind_because, found.measure) == ("one way", "turn back")
    assert found.tried == {size: (0, 4)}
    assert found.grows is grows


def test_a_cause_without_sizes_is_not_tried() -> None:
    for spot in (None, SPOT):
        search = SizeSearch.of("thermal_drift", None, spot, 20)
        assert (search.is_blind, search.done, search.next_round()) == (True, True, [])
        found = search.result()
        assert found.tried == {}
        if spot is None:
            assert found.blind_because is not None
            assert found.blind_because.startswith("these runs do not show it")
            assert found.measure == (EFFECTS["thermal_drift"].measure or None)
            assert found.measure
        else:
            assert (found.blind_because, found.measure) == ("one way", "turn back")


@pytest.mark.parametrize("cause", list(EFFECTS))
def test_a_size_is_named_by_what_a_draw_sets(cause: str) -> None:
    """The field that an effect names, else its first one: the field is there."""
    search = SizeSearch.of(cause, None, None, 1)
    effect = EFFECTS[cause]
    first = next(iter(effect.__dataclass_fields__))
    assert search.result().size_name == (effect.size_name or first)


LOWEST, HIGHEST = -16, 20


@pytest.mark.parametrize(
    ("tried", "wanted"),
    [
        ({}, [0, 0]),
        # Never named: larger, as far as there is something larger.
        ({0: (0, 2)}, [8, 8]),
        ({0: (0, 2), 16: (0, 2)}, [HIGHEST] * 2),
        ({0: (0, 2), HIGHEST: (0, 3)}, [HIGHEST] * 2),
        ({0: (0, 2), HIGHEST: (0, 4)}, []),
        # Always named: smaller, as far as there is something smaller.
        ({0: (2, 2)}, [-6, -6]),
        ({0: (2, 2), -12: (2, 2)}, [LOWEST] * 2),
    ],
)
def test_the_bracket(tried: dict[int, tuple[int, int]], wanted: list[int]) -> None:
    assert next_sizes(tried, LOWEST, HIGHEST, 20) == wanted


@pytest.mark.parametrize(
    "tried", [{0: (1, 2)}, {0: (3, 4), 6: (4, 4)}, {LOWEST: (2, 2)}, {LOWEST: (1, 2), 0: (2, 2)}]
)
def test_between_sizes_that_are_named_and_not_the_chance_is_asked(
    tried: dict[int, tuple[int, int]],
) -> None:
    """Of four chances, the larger at larger sizes."""
    steps = next_sizes(tried, LOWEST, HIGHEST, 20)
    assert len(steps) == 4
    assert steps == sorted(steps)
    assert steps[-1] > steps[0] or tried == {LOWEST: (2, 2)}
    assert LOWEST <= steps[0] <= steps[-1] <= HIGHEST


@pytest.mark.parametrize("left", [0, 1, 3])
def test_no_more_trials_than_are_left(left: int) -> None:
    assert len(next_sizes({0: (4, 8)}, LOWEST, HIGHEST, 8 + left)) == left
    assert len(next_sizes({0: (8, 8)}, LOWEST, HIGHEST, 8 + left)) == min(left, 2)
