"""Numbers that are told of outliers: evidence, share, size, rows, and what stands against them."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.effects.outliers import (
    Outliers,
    _at_reversals,
    _gathered,
    _is_scattered,
    _normal,
    _student,
)
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Simulation

SEED = 80_500
SIM = Simulation(sigma_arcsec=1.5)


def regression(noise: np.ndarray, runs: int = 2) -> Regression:
    """Runs of one way, each as long."""
    theta = np.linspace(0.0, 400.0, noise.size // runs)
    signals = join_runs([ta.CalibrationRun(theta, theta, 360.0)] * runs)
    return Regression.of(signals, noise, SIM.surroundings, rho=0.0)


def rows_of(found, size: int) -> np.ndarray:
    """Places of the rows told, the runs of ``size`` one after the other."""
    told = found.parameters["rows"].value
    return np.array([size * (int(label) - 1) + row for label, row in told])


def test_likelihoods_are_those_of_normal_and_student() -> None:
    e = np.random.default_rng(SEED).standard_t(4, 300)
    for scale in (0.85, 1.0, 1.1):
        assert _normal(e, scale) == pytest.approx(stats.norm.logpdf(e, scale=scale).sum())
        for nu in (2.5, 5.0, 40.0):
            expected = stats.t.logpdf(e, nu, scale=scale).sum()
            assert _student(e, nu, scale) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("nu", [3, 4, 6])
def test_heavy_tails_alone_are_no_outliers(nu: int) -> None:
    """A narrow and a wide normal fit Student's tails nearly as well: that is no evidence."""
    print("seeds", SEED, "to", SEED + 29)
    told = [
        Outliers.find_scatter(regression(np.random.default_rng(seed).standard_t(nu, 400)))
        for seed in range(SEED, SEED + 30)
    ]
    assert sum(found is not None for found in told) <= 3


@pytest.mark.parametrize("noise", ["normal", "uniform"])
@pytest.mark.parametrize(("size", "share"), [(40.0, 0.02), (300.0, 0.03)])
def test_share_size_and_evidence_are_those_of_two_normals(
    size: float, share: float, noise: str
) -> None:
    """Against what was put in, and the densities of one and of two normals written out."""
    print("seed", SEED)
    pulls, more, n = [], [0.0], 1600
    for seed in range(SEED, SEED + 25):
        rng = np.random.default_rng([seed, int(size)])
        e = 2.0 * (rng.normal(size=n) if noise == "normal" else rng.uniform(-1.73, 1.73, n))
        far = rng.random(n) < share
        e[far] += size * rng.normal(size=int(far.sum()))
        start = regression(e)
        found = Outliers.find_scatter(start)
        fraction, told = found.parameters["fraction"], found.parameters["size_arcsec"]
        left, rows = start.left_within_runs, rows_of(found, n // 2)
        assert (np.abs(left[rows]) > 4.0).all()
        # Beside a larger one a glitch does not end.
        away = np.convolve(far, [1.0, 1.0, 1.0], "same") == 1.0
        assert set(np.flatnonzero((np.abs(left) > 14.0) & away)) <= set(rows)
        assert told.value == pytest.approx(np.sqrt(np.mean(left[rows] ** 2)), rel=0.15)
        # Some are hidden in the noise, which the share's own error holds.
        assert abs(fraction.value - share) < 4.0 * fraction.std
        assert fraction.std >= max(np.sqrt(share * (1.0 - share) / n) / 2.0, 0.2 * fraction.value)
        assert fraction.std < 0.7 * fraction.value
        # A deviation of so many normal numbers.
        assert told.std == pytest.approx(told.value / np.sqrt(2.0 * rows.size), rel=1e-9)
        pulls.append(np.log(told.value / size) * told.value / told.std)
        assert found.weights[rows] == pytest.approx(1e-6)
        assert np.delete(found.weights, rows) == pytest.approx(1.0)
        (effect,) = found.effects
        assert (effect.fraction, effect.size_arcsec) == (fraction.value, told.value)
        narrow = told.value / found.size
        if noise == "normal":
            assert narrow == pytest.approx(2.0, rel=0.1)
        if noise == "normal" and size > 100.0:
            two = np.logaddexp(
                np.log(fraction.value) + stats.norm.logpdf(left, scale=told.value),
                np.log1p(-fraction.value) + stats.norm.logpdf(left, scale=narrow),
            ).sum()
            one = stats.norm.logpdf(left, scale=np.sqrt(np.mean(left**2))).sum()
            more.append(found.bic_gain - 2.0 * (two - one - np.log(n)))
    print(np.mean(pulls), np.std(pulls), np.mean(more))
    # What each reading is held against, the level about it, moves smaller ones more.
    assert abs(np.mean(more)) < 12.0
    assert 0.6 < np.std(pulls) < 1.4


@pytest.mark.parametrize("sizes", [(4000.0,), (-3000.0, 3500.0, 2800.0)])
def test_few_that_stand_apart_are_a_share_of_the_readings_with_their_rms(
    sizes: tuple[float, ...],
) -> None:
    """Beyond heavy tails, which a wide normal explains no better: by count and as they are."""
    print("seed", SEED + 2)
    e = np.random.default_rng(SEED + 2).standard_t(3, 3000)
    rows = [40, 900, 2100][: len(sizes)]
    e[rows] = sizes
    found = Outliers.find_scatter(regression(e))
    assert rows_of(found, 1500).tolist() == rows
    rms = np.sqrt(np.mean(np.square(sizes)))
    assert found.parameters["fraction"].value == pytest.approx(len(rows) / 3000.0)
    assert found.parameters["size_arcsec"].value == pytest.approx(rms, rel=0.01)


def test_bursts_are_stretches_of_two_and_more() -> None:
    print("seed", SEED + 1)
    e = np.random.default_rng(SEED + 1).normal(size=1200)
    for rows, bursts in (([50, 300, 700], 0), ([50, 51, 300, 700, 701, 702], 2)):
        shown = e.copy()
        shown[rows] += 60.0 * np.array([1.0, -1.3, 0.8, -1.1, 1.2, -0.9])[: len(rows)]
        found = Outliers.find_scatter(regression(shown))
        assert rows_of(found, 600).tolist() == rows
        told = found.parameters.get("bursts")
        assert (told.value if told else 0) == bursts


@pytest.mark.parametrize(("pairs", "turning", "scattered"), [
    (8, 8, False), (9, 9, True), (20, 6, False), (20, 7, True), (20, 20, True),
])  # fmt: skip
def test_pairs_change_sides_where_they_are_a_burst(
    pairs: int, turning: int, scattered: bool
) -> None:
    """More than eight, and than three tenths of them; a third reading apart is no pair."""
    e = np.ones(6000)
    first = 100 + 50 * np.arange(pairs)
    e[first[:turning]] = -1.0
    rows = np.sort(np.concatenate([first, first + 1, first + 3]))
    # By chance there are as many as rows^2 / n.
    assert _is_scattered(SimpleNamespace(left_within_runs=e, n=6_000_000), rows) == scattered
    crowded = SimpleNamespace(left_within_runs=e, n=rows.size**2 * 3 // max(pairs - 8, 1))
    assert not _is_scattered(crowded, rows)


def reversing(each: int, count: int) -> SimpleNamespace:
    """So many stretches of equal length in each of two runs."""
    segment = np.tile(np.repeat(np.arange(count), each), 2)
    segment[each * count :] += count
    run = np.repeat([0, 1], each * count)
    starts = [(0, each * count), (each * count, 2 * each * count)]
    signals = SimpleNamespace(segment=segment, run=run)
    return SimpleNamespace(signals=signals, n=segment.size, bounds=starts)


def test_rows_at_reversals_lie_within_three_readings_of_them() -> None:
    start = reversing(40, 3)
    for away, near in ((-4, False), (-3, True), (0, True), (2, True), (3, False)):
        # At three of the four reversals, and at one beside none.
        rows = np.array([40, 80, 160, 200]) + away
        assert _at_reversals(start, rows) == near
        # The beginning of a run is no reversal; half of them are not most.
        assert not _at_reversals(start, np.array([120, 0]) + abs(away))
        assert not _at_reversals(start, np.array([40 + away, 20]))
    assert not _at_reversals(start, np.zeros(0, dtype=np.int64))
    # Where more than half of all readings are near one, it says nothing.
    crowded = reversing(11, 12)
    assert not _at_reversals(crowded, np.array([11, 22, 33, 44]))


@pytest.mark.parametrize(("within", "said"), [
    (1, "the first reading"), (2, "the first 2 readings"), (4, "the first 4 readings"),
    (8, "the first 8 readings"),
])  # fmt: skip
def test_places_that_gather_after_a_start_are_told_with_their_chance(
    within: int, said: str
) -> None:
    """Of four reaches the least likely, by the binomial tail; a place counts once."""
    start = reversing(50, 4)
    begins = 50 * np.arange(8)
    at = begins + within - 1
    rows = np.sort(np.concatenate([at, at + 1, [25, 130]]))
    text = _gathered(start, rows)
    chance = 4.0 * stats.binom.sf(7, 10, within / 50.0)
    assert text.startswith(f"8 of its 10 places are among {said} after a start or a reversal")
    (told,) = re.findall(r"\(p (\S+)\)", text)
    assert float(told) == float(f"{chance:.1g}")
    # Most of the places, and more than by chance in a thousand.
    assert _gathered(start, np.sort(np.concatenate([at, 50 * np.arange(8) + 20]))) == ""
    assert _gathered(start, np.sort(np.concatenate([at, [70]]))) != ""
    few = at[:2]
    rare = 4.0 * stats.binom.sf(1, 2, within / 50.0) <= 1e-3
    assert (_gathered(start, few) != "") == rare
