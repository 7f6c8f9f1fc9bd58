"""Sizes that are tried: by rounds written out, and where the chance is as aimed at."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.rehearsal.detection import Chance, SizeRange
from trueangle.rehearsal.rehearse import SizeSearch, next_sizes
from trueangle.rehearsal.trial import NAMED, NOTHING, Trial, TrialOutcome

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
