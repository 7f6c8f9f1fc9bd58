"""What each test tells of the structure that fires it: how large, where, and against what noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f, ttest_1samp

from trueangle.diagnosis.goodness import FREE_PATH, LEVEL, Unexplained, goodness_of_fit
from trueangle.diagnosis.goodness.events import CONSTANTS, reversal_test, start_test
from trueangle.diagnosis.goodness.evidence import Evidence
from trueangle.diagnosis.goodness.noise import Noise, estimate_noise
from trueangle.diagnosis.goodness.periodogram import order_test, time_test
from trueangle.diagnosis.goodness.place import ModulatedSums, place_tests
from trueangle.diagnosis.goodness.scatter import repeats, scatter_tests
from trueangle.diagnosis.goodness.steps import steps_test
from trueangle.diagnosis.goodness.zeros import run_test, variance_of_mean

from .readings import leftover
from .test_events import readings

#: Of a structure twice the noise in thousands of readings, its rms is told to a few percent; what
#: hides in lines, levels and means of the fit takes a few more.
NEAR = 0.08


def own(left, values):
    """An angle of each run's own."""
    return values[left.run]


#: Deciding tests, what is hidden (of rms 1), and what is told of it in words.
HIDDEN = {
    "place": (
        lambda m, rng: np.sqrt(2.0) * np.sin(12.0 * m.theta + 1.0),
        lambda left: next(e for e in place_tests(left) if e.test == "place"),
        (12.0, 2.0 * np.sqrt(2.0)),
    ),
    "place x direction": (
        lambda m, rng: np.sqrt(2.0) * m.direction * np.cos(7.0 * m.theta),
        lambda left: next(e for e in place_tests(left) if e.test == "place x direction"),
        (7.0, 2.0 * np.sqrt(2.0)),
    ),
    "place x direction x temperature": (
        lambda m, rng: m.direction * np.sign(m.temperature - 27.5),
        lambda left: next(
            e for e in place_tests(left) if e.test == "place x direction x temperature"
        ),
        (2.0,),
    ),
    "time periodogram": (
        lambda m, rng: np.sqrt(2.0) * np.sin(14.451 * m.clock + own(m, 6.0 * rng.random(40))),
        time_test,
        (2.3, 2.0 * np.sqrt(2.0)),
    ),
    "place within runs": (
        lambda m, rng: np.sqrt(2.0) * np.sin(17.4 * m.theta + own(m, 6.28 * rng.random(40))),
        lambda left: order_test(left, 110),
        (17.4, 2.0 * np.sqrt(2.0)),
    ),
    "zeros of the runs": (
        lambda m, rng: own(m, np.resize([1.0, -1.0], 40)),
        lambda left: run_test(left, estimate_noise(left)),
        (2.0 * np.sqrt(24.0 / 23.0),),
    ),
}  # fmt: skip


def numbers(says: str) -> list[float]:
    """Numbers of a sentence in their order."""
    return [float(x) for x in re.findall(r"(?<![\w.])\d+\.?\d*(?:e-?\d+)?", says)]


@pytest.mark.parametrize("test", HIDDEN)
def test_a_structure_is_told_with_its_size_and_place(test: str) -> None:
    structure, asked, told = HIDDEN[test]
    left = leftover("rich", "gauss", 71, structure, 2.0)
    found = asked(left)
    assert found.test == test
    assert found.p < 1e-6
    spread = np.sqrt(24.0 / 23.0) if test == "zeros of the runs" else 1.0
    assert found.rms == pytest.approx(2.0 * spread, rel=NEAR)
    assert numbers(found.says) == pytest.approx(list(told), rel=NEAR)
    if len(told) == 2 and "place x" not in test and test != "place":
        assert found.at == pytest.approx(told[0], rel=0.01)
    assert str(told[0]) == "2.3" or "Hz" not in found.says


def test_what_follows_the_direction_has_the_rms_of_the_readings_that_move() -> None:
    """A joint that rests in three readings of four; its play of 2 is told as that."""
    left = leftover("rich", "gauss", 78)
    direction = np.where(np.arange(len(left)) % 4, 0.0, left.direction)
    left = replace(left, residual=left.residual + 2.0 * direction, direction=direction)
    found = next(e for e in place_tests(left) if e.test == "place x direction")
    assert "at every place" in found.says
    assert numbers(found.says) == pytest.approx([2.0], rel=NEAR)
    assert found.rms == pytest.approx(1.0, rel=NEAR)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_sizes_are_those_of_the_errors_and_places_those_of_the_axis(way: float) -> None:
    """Errors in other units, of the other sign; a clock twice as fast; the joint mirrored."""
    structure = HIDDEN["time periodogram"][0]
    left = leftover("split", "gauss", 72, structure, 1.0)
    other = replace(
        left,
        residual=-1000.0 * left.residual,
        clock=2.0 * left.clock,
        theta=way * left.theta,
        direction=way * left.direction,
        kept={},
    )
    pairs = [goodness_of_fit(each, 64.0, sigma) for each, sigma in ((left, 1.2), (other, 1200.0))]
    told = [{item.test: item for item in fit.evidence} for fit in pairs]
    assert told[0].keys() == told[1].keys()
    for name, item in told[0].items():
        again = told[1][name]
        # Cells of a transform begin at the other end of a mirrored way.
        near = 0.05 if name == "place within runs" and way < 0.0 else 1e-6
        assert again.p == pytest.approx(item.p, rel=near, abs=max(near, 1e-12)), name
        assert again.rms == pytest.approx(1000.0 * item.rms, rel=near), name
        if item.at is not None:
            per = 0.5 if name == "time periodogram" else 1.0
            assert again.at == pytest.approx(per * item.at, rel=1e-9), name
    assert pairs[1].rms == pytest.approx(1000.0 * pairs[0].rms)
    assert pairs[1].share == pytest.approx(pairs[0].share)
    assert pairs[1].noise.sigma == pytest.approx(1000.0 * pairs[0].noise.sigma)


def test_lines_over_readings_are_no_hertz() -> None:
    left = replace(leftover("rich", "gauss", 71, HIDDEN["time periodogram"][0], 2.0), timed=False)
    assert "cycles per reading" in time_test(left).says


def test_steps_are_told_by_their_number_and_half_of_their_height() -> None:
    left = readings("gauss", 9_100)
    run = np.arange(len(left)) - 240 * left.run
    # Two levels: one step a run in nine of the ten, at a place of its own.
    levels = np.where((run > 60 + 12 * left.run) & (left.run < 9), 3.0, -3.0)
    left.residual[:] = 0.3 * left.residual + levels
    found = steps_test(left)
    count, size = numbers(found.says)
    # A block that a step cuts may count as another one.
    assert abs(count - 9) <= 1
    assert size == pytest.approx(6.0, rel=NEAR)
    assert found.rms == pytest.approx(3.0, rel=NEAR)


@pytest.mark.parametrize("constant", CONSTANTS)
@pytest.mark.parametrize("asked", [reversal_test, start_test])
def test_what_relaxes_is_told_by_its_rms_and_time(asked, constant: float) -> None:
    """In shares of the time between reversals (4 s) or of a run (24 s)."""
    left = readings("gauss", 9_200)
    events = np.diff(left.run, prepend=-1) != 0
    if asked is reversal_test:
        events |= np.diff(left.direction, prepend=0.0) != 0.0
    first = np.flatnonzero(events)
    stretch = np.cumsum(events) - 1
    tau = constant * (4.0 if asked is reversal_test else 24.0)
    decay = np.exp(-(left.clock - left.clock[first][stretch]) / tau)
    decay = decay - (np.bincount(stretch, decay) / np.bincount(stretch))[stretch]
    if asked is reversal_test:
        decay *= left.direction
        # What follows the start of a run is no reversal.
        decay[np.isin(stretch, stretch[np.flatnonzero(np.diff(left.run, prepend=-1))])] = 0.0
    # Of the size of the noise: larger, what tells runs apart is not the noise.
    left.residual[:] += decay / np.std(decay)
    found = asked(left)
    # One of three time constants, neighbours of which are half alike.
    (told,) = numbers(found.says)
    span = tau / constant
    assert min(abs(told / (c * span) - 1.0) for c in CONSTANTS) < 0.06
    assert 0.3 < told / tau < 4.5
    assert found.rms == pytest.approx(1.0, rel=0.25)


def test_the_chance_of_modulated_sums_is_that_of_student() -> None:
    rng = np.random.default_rng(3)
    for n in (3, 8, 24):
        sums = rng.normal(0.5, 1.0, n)
        wanted = ttest_1samp(sums, 0.0).pvalue
        assert ModulatedSums(sums, 1.0).chance() == pytest.approx(wanted, rel=1e-9)
        signs = rng.choice([-1.0, 1.0], n)
        wanted = ttest_1samp(signs * sums, 0.0).pvalue
        assert ModulatedSums(sums, -1.0).chance(signs) == pytest.approx(wanted, rel=1e-9)
    assert ModulatedSums(sums, 0.0).chance() == 1.0


# -- the decision ----------------------------------------------------------------------


def item(p: float, rms: float = 1.0, decides: bool = True, looks_like: str = "") -> Evidence:
    return Evidence(f"{p:g}", 1.0, p, "", decides, rms, None, looks_like)


def made(*evidence: Evidence) -> Unexplained:
    return Unexplained(True, 1.0, 1.0, list(evidence), Noise(1.0, 0.0, 0.1, 0.0, 10.0))


def test_tests_fire_at_one_percent_for_all_of_their_kind_together() -> None:
    deciding = [item(part * LEVEL / 4.0) for part in (0.9, 1.1, 3.9)]
    path = item(0.7, 9.0, looks_like=FREE_PATH)
    noise = [item(part * LEVEL / 3.0, decides=False) for part in (0.95, 1.05, 2.9)]
    fit = made(*deciding, path, *noise)
    assert fit.firing == [deciding[0], path]
    assert fit.noise_firing == [noise[0]]


def test_what_is_beside_a_path_is_the_largest_that_fires() -> None:
    fit = made(item(0.0, 2.0), item(0.0, 5.0), item(0.0, 9.0, looks_like=FREE_PATH), item(0.9, 7.0))
    assert fit.beside_path == 5.0
    assert made(item(0.0, 9.0, looks_like=FREE_PATH)).beside_path == 0.0
    assert made(item(0.0, 0.0)).beside_path > 0.0


def test_the_share_is_of_the_variance_with_paths_in_time() -> None:
    left = leftover("rich", "gauss", 71, HIDDEN["place"][0], 2.0)
    slow = replace(left, residual=left.residual + 3.0 * np.sin(left.clock / 40.0))
    path = item(0.3, 2.5, looks_like=FREE_PATH)
    for loose, beside in ((None, None), (slow, path)):
        fit = goodness_of_fit(left, 40.0, loose=loose, path=beside)
        assert fit.found
        assert fit.rms == pytest.approx(max(e.rms for e in fit.firing))
        assert fit.share == pytest.approx(fit.rms**2 / np.var((loose or left).residual))
    assert fit.rms == pytest.approx(2.5)


# -- the noise -------------------------------------------------------------------------


def test_white_noise_is_that_of_least_squares_beside_the_pattern() -> None:
    """By lstsq: a mean of each run and lines, alike and by direction; their degrees of freedom."""
    left = leftover("few", "uniform", 74)
    found = estimate_noise(left, orders=2)
    d, x = left.direction[:, None], np.outer(left.theta, [1.0, 2.0])
    waves = np.hstack([np.cos(x), np.sin(x)])
    runs = (left.run[:, None] == np.unique(left.run)).astype(float)
    design = np.hstack([runs, waves, d, d * waves])
    rest, rank = np.linalg.lstsq(design, left.residual, rcond=None)[1:3]
    assert found.correlation == 0.0
    assert found.freedom == len(left) - rank == 900 - 3 - 9
    assert found.sigma == pytest.approx(np.sqrt(rest[0] / found.freedom), rel=1e-9)


def test_the_error_of_a_correlation_is_by_how_much_seeds_scatter() -> None:
    """Of 150 pulls the deviation is known to 6 %."""
    found = [estimate_noise(leftover("few", "ar 0.5", 7_500 + s)) for s in range(150)]
    pulls = [(noise.correlation - 0.5) / noise.std for noise in found]
    print(np.mean(pulls), np.std(pulls))
    assert 0.8 < np.std(pulls) < 1.2
    assert abs(np.mean(pulls)) < 0.4


def repeated(kind: str, seed: int):
    """Ten runs at the same places, of a pattern that each run shares."""
    left = leftover("grid", kind, seed)
    return replace(left, residual=left.residual + 3.0 * np.sin(11.0 * left.theta))


@pytest.mark.parametrize("kind", ["gauss", "ar 0.5"])
def test_repeats_tell_the_noise_as_a_pattern_does(kind: str) -> None:
    """Both are of the same readings: the p value may be careful, never hasty."""
    p, ratios = [], []
    for seed in range(60):
        left = repeated(kind, 7_700 + seed)
        found = {e.test: e for e in scatter_tests(left, estimate_noise(left))}
        p.append(found["noise against repeats"].p)
        ratios.append(found["noise against repeats"].statistic)
    print(np.mean(ratios), np.std(ratios), sorted(p)[:4])
    # Noise of all readings over that of what repeats, each known to 2 %, the same readings.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.01)
    # Of sixty at 5 % nine or more have a chance of 0.3 %.
    assert np.count_nonzero(np.array(p) < 0.05) < 9


def test_repeats_count_as_many_independent_squares_as_there_are() -> None:
    """Less a mean of each place and way, and of each run; squares are correlated by the square."""
    left = repeated("ar 0.5", 7_900)
    noise = estimate_noise(left)
    value, freedom = repeats(left)
    assert freedom == 1800 - 2 * 180 - 9
    lags = np.arange(-60, 61)
    worth = 1.0 / np.sum(noise.correlation ** (2.0 * np.abs(lags)))
    found = {e.test: e for e in scatter_tests(left, noise)}["noise against repeats"]
    assert found.statistic == pytest.approx(noise.sigma / value)
    wanted = f.sf(found.statistic**2, worth * noise.freedom, worth * freedom)
    assert found.p == pytest.approx(wanted, rel=1e-6)


def test_the_zeros_of_runs_are_no_scatter_of_repeats() -> None:
    left = repeated("gauss", 7_800)
    plain = {e.test: e.statistic for e in scatter_tests(left, estimate_noise(left))}
    moved = replace(left, residual=left.residual + 50.0 * np.cos(9.0 * left.run), kept={})
    other = {e.test: e.statistic for e in scatter_tests(moved, estimate_noise(moved))}
    assert other["noise against repeats"] == pytest.approx(plain["noise against repeats"])


@pytest.mark.parametrize(("kind", "word"), [("t5", "heavier"), ("uniform", "lighter")])
def test_tails_are_called_what_they_are(kind: str, word: str) -> None:
    left = leftover("rich", kind, 76)
    found = {e.test: e for e in scatter_tests(left, estimate_noise(left), 2.0, 6.0)}
    assert word in found["tails"].says
    # Rounding adds a twelfth of the square of its step to what is stated.
    assert numbers(found["noise against the simulation's"].says)[-1] == pytest.approx(
        2.65, abs=0.01
    )
    assert found["noise against the simulation's"].statistic == pytest.approx(
        1.0 / np.sqrt(7.0), rel=0.03
    )


def test_zeros_of_few_runs_differ_by_more_than_their_means_scatter() -> None:
    """Of three: their variance has two degrees of freedom, and noise has a part in it."""
    left = leftover("few", "gauss", 77, lambda m, rng: own(m, np.array([1.0, -1.0, 3.0])), 0.2)
    noise = estimate_noise(left)
    means = [float(left.residual[a:b].mean()) for a, b in left.bounds]
    scatter = np.mean([variance_of_mean(b - a, noise) for a, b in left.bounds])
    found = run_test(left, noise)
    assert found.rms == pytest.approx(np.sqrt(np.var(means, ddof=1) - scatter))
    assert found.statistic == pytest.approx(np.var(means, ddof=1) / scatter)
