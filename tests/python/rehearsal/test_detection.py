"""Sizes from which on a cause is named, against the weight of all curves, in loops."""

from __future__ import annotations

import math

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from trueangle.rehearsal.detection import HIGH, LAPSES, LOW, WIDTHS, Chance, binomial_interval
from trueangle.rehearsal.result import SHARES, rehearsed_cause
from trueangle.rehearsal.trial import TrialOutcome
from trueangle.rehearsal.visibility import STEPS, SizeRange

TRIED = {-4: (0, 4), 0: (1, 6), 3: (4, 6), 6: (6, 7), 10: (5, 6)}


def curves(tried: dict[int, tuple[int, int]]):
    """Place, width, share never named and weight of every curve, one by one."""
    low, high = min(tried), max(tried)
    for half in range(2 * (low - 12), 2 * (high + 12) + 1):
        for width in WIDTHS:
            for lapse, before in LAPSES.items():
                weight = before
                for step, (named, count) in tried.items():
                    p = (1.0 - lapse) / (1.0 + math.exp(-(step - half / 2.0) / width))
                    p = min(max(p, 1e-9), 1.0 - 1e-9)
                    weight *= p**named * (1.0 - p) ** (count - named)
                yield half / 2.0, width, lapse, weight


@pytest.fixture(scope="module")
def weighed() -> np.ndarray:
    found = np.array([*curves(TRIED)])
    found[:, 3] /= found[:, 3].sum()
    return found


@pytest.mark.parametrize("share", SHARES)
def test_a_threshold_is_the_quantile_of_all_curves(weighed: np.ndarray, share: float) -> None:
    place, width, lapse, weight = weighed.T
    reach = 1.0 - lapse
    step = np.full(place.size, np.inf)
    can = reach > share
    step[can] = place[can] + width[can] * np.log(share / (reach[can] - share))
    chance = Chance(TRIED)
    found = chance.threshold(share)
    for told, at in ((found.step, 0.5), (found.low, LOW), (found.high, HIGH)):
        wanted = chance.quantile(share, at)
        below = weight[step <= wanted].sum()
        assert below >= at - 1e-9
        assert weight[step < wanted].sum() <= at + 1e-9
        inside = -4.0 <= wanted <= 10.0
        assert told == (wanted if inside else None)
    assert (LOW, HIGH) == (0.025, 0.975)


def test_the_chance_at_a_size_is_the_mean_over_all_curves(weighed: np.ndarray) -> None:
    place, width, lapse, weight = weighed.T
    steps = np.array([-6.0, 1.5, 20.0])
    wanted = [float(weight @ ((1.0 - lapse) / (1.0 + np.exp(-(k - place) / width)))) for k in steps]
    assert Chance(TRIED).at(steps) == pytest.approx(wanted, rel=1e-9)
    drawn = Chance(TRIED).curve(lambda step: 2.0**step)
    assert drawn[0][0] == pytest.approx(2.0**-6)
    assert drawn[-1][0] == pytest.approx(2.0**12)
    assert np.all(np.diff([p for _, p in drawn]) > 0.0)


@pytest.mark.parametrize("count", [1, 4, 10, 37])
def test_intervals_of_shares_are_wilsons(count: int) -> None:
    for named in range(count + 1):
        low, high = proportion_confint(named, count, alpha=0.05, method="wilson")
        assert binomial_interval(named, count) == pytest.approx((low, high), abs=2e-5)


@pytest.mark.parametrize("grows", [True, False])
def test_what_is_told_of_a_cause_is_counted(grows: bool) -> None:
    """Sizes either way from the first; the less visible end of an interval first."""
    sizes = SizeRange(3.0, -16, 20, grows)
    answers = []
    for step, (named, count) in TRIED.items():
        for k in range(count):
            if k < named:
                answers.append((step, TrialOutcome("named", beside=("latency",) if k else ())))
            else:
                instead = ("thermal_drift", "backlash") if k % 2 else ("backlash",)
                answers.append((step, TrialOutcome("taken_for_another", instead)))
    found = rehearsed_cause("x", "size", sizes, answers, "blind", "measure")
    sign = 1.0 if grows else -1.0
    wanted = {3.0 * 2.0 ** (sign * step / STEPS): tried for step, tried in TRIED.items()}
    assert list(found.tried.values()) == list(wanted.values())
    assert list(found.tried) == pytest.approx(list(wanted))
    assert found.trials == 29
    assert found.told == {"named": 16, "taken_for_another": 13}
    assert list(found.confused_with) == ["backlash", "thermal_drift"]
    assert found.confused_with["backlash"] == 13
    assert found.beside == {"latency": 12}
    assert found.blind_because is found.measure is None  # it was named
    chance = Chance(TRIED)
    for share, told in zip(SHARES, (found.named_50, found.named_95), strict=True):
        of = chance.threshold(share)
        for step, size in zip((of.step, of.low, of.high), (told, *found.intervals[share]),
                              strict=True):  # fmt: skip
            if step is None:
                assert size is None
            else:
                assert size == pytest.approx(3.0 * 2.0 ** (sign * step / STEPS))
    plain = found.to_dict()
    assert plain["trials"] == 29
    assert plain["tried"][1]["interval"] == pytest.approx(
        proportion_confint(1, 6, alpha=0.05, method="wilson"), abs=2e-5
    )
    assert plain["named_50_interval"] == list(found.intervals[0.5])
    assert plain["named_95_interval"] == list(found.intervals[0.95])
    never = rehearsed_cause("x", "size", sizes, [(0, TrialOutcome("nothing"))], "blind", "measure")
    assert (never.blind_because, never.measure, never.ever_named) == ("blind", "measure", False)


def test_causes_named_instead_come_by_how_often_then_by_name():
    """Counts that run against the alphabet, and two that are equal."""
    often = {"backlash": 1, "clock_drift": 3, "latency": 7, "scale_error": 3}
    answers = [
        (0, TrialOutcome("taken_for_another", instead=(cause,), beside=(cause,)))
        for cause, count in often.items()
        for _ in range(count)
    ]
    told = rehearsed_cause("x", "size", None, answers, None, None)
    for counted in (told.confused_with, told.beside):
        assert [*counted.items()] == [
            ("latency", 7), ("clock_drift", 3), ("scale_error", 3), ("backlash", 1)
        ]  # fmt: skip


def test_the_weights_are_those_that_the_words_tell() -> None:
    """From 5 to 95 % in a third of an octave to six; shares never named weigh one in all."""
    octaves = 2.0 * math.log(19.0) * WIDTHS / STEPS
    assert octaves[[0, -1]] == pytest.approx([1.0 / 3.0, 6.0], rel=0.12)
    assert np.diff(np.log(WIDTHS)) == pytest.approx(np.full(12, math.log(16.0) / 12.0))
    assert sum(LAPSES.values()) == pytest.approx(1.0)
    assert SHARES == (0.5, 0.95)


def test_a_threshold_at_the_least_or_greatest_size_is_given() -> None:
    """The sizes tried bracket it, themselves included; beyond either side it is open."""
    chance = Chance(TRIED)
    assert [chance._inside(step) for step in (-4.0, 10.0, -4.5, 10.5)] == [-4.0, 10.0, None, None]


def test_a_curve_is_drawn_in_sixty_places() -> None:
    drawn = Chance(TRIED).curve(lambda step: step)
    assert [step for step, _ in drawn] == pytest.approx([-6.0 + 18.0 * k / 59.0 for k in range(60)])


def test_binomial_intervals_are_shares() -> None:
    for count in range(1, 40):
        for named in (0, count):
            low, high = binomial_interval(named, count)
            assert 0.0 <= low <= high <= 1.0
