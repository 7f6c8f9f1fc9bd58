"""Sizes from which on a cause is named, against the weight of all curves, in loops."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.effects.drawing import Drawing
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.rehearsal import detection
from trueangle.rehearsal.detection import (
    DOWN,
    FIRST,
    HIGH,
    LAPSES,
    LOW,
    NEAR,
    STEPS,
    UP,
    WIDTHS,
    Chance,
    SizeRange,
    _deviance,
    binomial_interval,
    size_range,
)
from trueangle.rehearsal.result import SHARES, rehearsed_cause
from trueangle.rehearsal.trial import TrialOutcome
from trueangle.simulation import Backlash, HeteroscedasticNoise, RunDesign, Simulation, simulate

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


N = 720


def believed(sigma: float = 2.0, samples: int = N) -> Simulation:
    return Simulation(
        sigma_arcsec=sigma,
        runs=(RunDesign(label="a", turns=2.0, samples=samples, reversals=(0.5,)),),
    )


def regression_of(sim: Simulation) -> Regression:
    signals = join_runs(simulate(sim, seed=1))
    return Regression.of(signals, np.zeros(len(signals)), sim.surroundings)


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_play_shows_as_the_square_of_its_half_width_in_the_noise(sigma: float) -> None:
    """As many readings either way: n h^2 / sigma^2."""
    sim = believed(sigma)
    regression = regression_of(sim)
    way = np.sign(np.asarray(regression.signals.direction))
    about = float(((way - way.mean()) ** 2).sum())
    found = _deviance(Backlash(3.0), regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(about * 9.0 / sigma**2, rel=0.02)


def test_noise_that_varies_shows_as_half_the_variance_of_its_logarithm() -> None:
    """Fisher's information of the logarithm of a variance is a half for every reading."""
    sim = believed()
    regression = regression_of(sim)
    kind = EFFECTS["heteroscedastic_noise"]
    assert kind is HeteroscedasticNoise
    effect = kind.drawn(
        1.0, Drawing(regression.signals, sim.surroundings, np.random.default_rng(2))
    )
    factor = effect.noise_factor(regression.signals, sim.surroundings)
    found = _deviance(effect, regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(0.5 * N * np.var(np.log(factor**2)), rel=1e-9)


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_what_the_writing_changes_shows_as_its_energy(sigma: float) -> None:
    """Every reading written an arcsec off: n / sigma^2, whatever the noise."""
    sim = believed(sigma)
    regression = regression_of(sim)
    made = SimpleNamespace(
        signal=lambda signals, around, rng: np.zeros(len(signals)),
        written=lambda degrees: degrees + np.resize([1.0, -1.0], degrees.size) / 3600.0,
        noise_factor=lambda signals, around: None,
    )
    found = _deviance(made, regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(N / sigma**2, rel=1e-6)


@pytest.mark.parametrize(("sigma", "samples"), [(0.5, 720), (2.0, 720), (2.0, 180)])
def test_the_first_size_of_play_and_the_range_about_it(sigma: float, samples: int) -> None:
    sim = believed(sigma, samples)
    signals = join_runs(simulate(sim, seed=1))
    sizes = size_range(sim, signals, "backlash", 3)
    assert sizes is not None
    first = np.sqrt(FIRST / samples) * sigma
    assert sizes.first == pytest.approx(first, rel=np.sqrt(NEAR) - 1.0 + 0.02)
    assert sizes.lowest == np.log2(DOWN) * STEPS
    # Up to thirty times the noise of a reading.
    top = np.log2(UP * np.sqrt(samples / FIRST)) * STEPS
    assert sizes.highest == int(np.floor(top))
    assert sizes.grows
    assert sizes.size(STEPS) == pytest.approx(2.0 * sizes.first)
    assert sizes.size(-STEPS) == pytest.approx(0.5 * sizes.first)


def test_blind_is_a_cause_whose_naming_would_be_a_guess(monkeypatch: pytest.MonkeyPatch) -> None:
    """None whose form all share, none that is never doubted; of two reasons the first."""
    spots = [
        Ambiguity(("backlash", "latency"), "one", "measure", common="backlash"),
        Ambiguity(("latency", "missing_order", "scale_error"), "two", "measure"),
    ]
    monkeypatch.setattr(detection, "blind_spots", lambda regression: spots)
    sim = believed()
    found = detection.blind_causes(sim, join_runs(simulate(sim, seed=1)))
    assert {cause: spot.because for cause, spot in found.items()} == {
        "latency": "one", "scale_error": "two"
    }  # fmt: skip


# -- the search for the first size, with a law that is given ----------------------------


def sized(
    monkeypatch: pytest.MonkeyPatch,
    law: Callable[[float, int], float | None],
    grows: bool = True,
    most: float = np.inf,
    seed: int = 3,
) -> tuple[SizeRange | None, list[tuple[int, str, int]]]:
    """The sizes of an effect whose deviance is a law of size and draw; whose numbers were asked."""
    asked: list[tuple[int, str, int]] = []
    kind = SimpleNamespace(size_grows=grows, size_most=most)
    monkeypatch.setattr(detection, "EFFECTS", {"x": kind})
    monkeypatch.setattr(detection, "trial_rng", lambda *key: asked.append(key) or key[2])

    def drawn(cause: str, size: float, of: Any) -> Any:
        found = law(size, of.rng)
        return None if found is None else (found,)

    monkeypatch.setattr(detection, "drawn_effect", drawn)
    monkeypatch.setattr(detection, "_deviance", lambda effect, *more: effect[0])
    sim = believed()
    return size_range(sim, join_runs(simulate(sim, seed=1)), "x", seed), asked


TOP = int(np.floor(np.log2(UP * np.sqrt(N / FIRST)) * STEPS))


def test_the_mean_of_four_draws_is_met_within_a_fifth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the trials' own numbers; one that these runs cannot have shows nothing."""
    draws = {0: 1.0, 1: None, 2: 5.0, 3: 10.0}
    sizes, asked = sized(
        monkeypatch, lambda size, k: None if draws[k] is None else draws[k] * size**2, seed=8
    )
    assert sizes is not None
    assert FIRST / 1.2 < 4.0 * sizes.first**2 < FIRST * 1.2
    assert set(asked) == {(8, "x", number) for number in range(4)}
    assert (sizes.lowest, sizes.highest, sizes.grows) == (-16, TOP, True)


@pytest.mark.parametrize("grows", [True, False])
@pytest.mark.parametrize("scale", [1e-40, 1e-3, 1.0, 1e3, 1e40])
def test_a_first_size_is_found_from_far_off(
    monkeypatch: pytest.MonkeyPatch, scale: float, grows: bool
) -> None:
    """Up or down by many powers of ten, the other way where smaller ones show more."""
    sizes, _ = sized(
        monkeypatch, lambda size, k: scale * (size if grows else 1.0 / size) ** 2, grows
    )
    assert sizes is not None
    met = scale * (sizes.first if grows else 1.0 / sizes.first) ** 2
    assert FIRST / NEAR < met < FIRST * NEAR
    assert (sizes.lowest, sizes.highest, sizes.grows) == (-16, TOP, grows)


@pytest.mark.parametrize("most", [0.125, 2.0, 16.0])
def test_no_size_is_beyond_what_an_effect_may_have(
    monkeypatch: pytest.MonkeyPatch, most: float
) -> None:
    """The first is not, nor is the highest; and none is asked for."""
    tried: list[float] = []

    def law(size: float, number: int) -> float:
        tried.append(size)
        return 2.0 * size**2

    sizes, _ = sized(monkeypatch, law, most=most)
    assert sizes is not None
    assert max(tried) <= most
    assert sizes.first == pytest.approx(min(most, np.sqrt(20.0)), rel=0.1)
    assert sizes.size(sizes.highest) <= most < sizes.size(sizes.highest + 1)
    assert tried[0] == min(1.0, most)


def test_a_law_of_leaps_ends_at_the_largest_size_of_the_range(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing below a size, and far too much above: steps of eight octaves at most."""
    tried: list[float] = []

    def law(size: float, number: int) -> float:
        tried.append(size)
        return 1e-200 * size if size < 2.0**30 else 1e200

    sizes, _ = sized(monkeypatch, law)
    assert sizes is not None
    # Two looks at the start, a smaller size, and every one that follows.
    moves = np.diff(np.log2(tried[12::4]))
    assert set(moves.round(9)) == {8.0, -8.0}
    assert len(tried) == 4 * (3 + 40)


@pytest.mark.parametrize("grows", [True, False])
def test_an_effect_of_one_size_has_no_range_and_one_that_never_shows_none_at_all(
    monkeypatch: pytest.MonkeyPatch, grows: bool
) -> None:
    for value, wanted in ((7.0, SizeRange(1.0, 0, 0, grows)), (0.0, None)):
        sizes, _ = sized(monkeypatch, lambda size, k, value=value: value, grows)
        assert sizes == wanted
    assert sized(monkeypatch, lambda size, k: None, grows)[0] is None


def test_few_readings_have_no_size_above_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the range ends at the first size, that is the highest."""
    sizes, _ = sized(monkeypatch, lambda size, k: 1e-3 * size**2, most=1.0)
    assert sizes is not None
    assert (sizes.first, sizes.highest) == (1.0, 0)


def test_the_numbers_of_the_search_are_those_that_its_words_tell() -> None:
    """Steps of a quarter of an octave, a deviance of 40, up to thirty times the noise."""
    assert (STEPS, FIRST, DOWN, UP, NEAR) == (4, 40.0, 1.0 / 16.0, 30.0, 1.2)
    assert detection.DRAWS == 4


def test_what_the_zero_and_the_lines_take_shows_nothing() -> None:
    """An error that is the same at all readings, beside one that is not."""
    sim = believed()
    regression = regression_of(sim)
    for column, shows in (
        (np.ones(N), False),
        (np.where(np.asarray(regression.signals.direction) > 0, 1.0, -1.0), True),
    ):
        made = SimpleNamespace(
            signal=lambda signals, around, rng, column=column: 5.0 * column,
            written=lambda degrees: degrees,
            noise_factor=lambda signals, around: None,
        )
        found = _deviance(made, regression, np.random.default_rng(1), sim)
        assert (found > 100.0) is shows
        assert shows or found == 0.0
