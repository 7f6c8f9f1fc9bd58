"""The noise against least squares, against repeats and against what is stated."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f

from trueangle.diagnosis.goodness.noise import estimate_noise
from trueangle.diagnosis.goodness.scatter import scatter_of_repeats, scatter_tests
from trueangle.diagnosis.goodness.zeros import run_test, variance_of_mean

from .readings import leftover


def test_white_noise_is_that_of_least_squares_beside_the_pattern() -> None:
    """By lstsq: a mean of each run and lines, alike and by direction; their degrees of freedom."""
    left = leftover("few", "uniform", 74)
    found = estimate_noise(left)
    # Of a turn and in both directions: orders to twelve, with their difference by direction.
    d, x = left.direction[:, None], np.outer(left.theta, np.arange(1.0, 13.0))
    waves = np.hstack([np.cos(x), np.sin(x)])
    runs = (left.run[:, None] == np.unique(left.run)).astype(float)
    design = np.hstack([runs, waves, d, d * waves])
    rest, rank = np.linalg.lstsq(design, left.residual, rcond=None)[1:3]
    assert found.correlation == 0.0
    assert found.freedom == len(left) - rank == 900 - 3 - 49
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
    value, freedom = scatter_of_repeats(left)
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
    found = {e.test: e for e in scatter_tests(left, estimate_noise(left), np.sqrt(7.0))}
    assert word in found["tails"].says
    said = found["noise against the simulation's"].says
    assert re.search(r"states 2\.65 arcsec$", said), said
    assert found["noise against the simulation's"].statistic == pytest.approx(
        1.0 / np.sqrt(7.0), rel=0.03
    )


def test_zeros_of_few_runs_differ_by_more_than_their_means_scatter() -> None:
    """Of three: their variance has two degrees of freedom, and noise has a part in it."""
    left = leftover("few", "gauss", 77, lambda m, rng: np.array([1.0, -1.0, 3.0])[m.run], 0.2)
    noise = estimate_noise(left)
    means = [float(left.residual[a:b].mean()) for a, b in left.bounds]
    scatter = np.mean([variance_of_mean(b - a, noise) for a, b in left.bounds])
    found = run_test(left, noise)
    assert found.rms == pytest.approx(np.sqrt(np.var(means, ddof=1) - scatter))
    assert found.statistic == pytest.approx(np.var(means, ddof=1) / scatter)
