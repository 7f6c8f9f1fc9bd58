"""Patterns beside nuisances against plain least squares, and their stated errors."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.selfcalibration.dense import fit_dense, low_frequency_inflation
from trueangle.selfcalibration.densetriangle import (
    DenseRows,
    _evidence,
    solved_triangle,
    triangle_of,
)
from trueangle.selfcalibration.orderchoice import significant_orders
from trueangle.selfcalibration.projected import Projected, Unknown, harmonic_unknowns

N = 300
COLUMNS = harmonic_unknowns("the encoder", [1, 2])


def rows(seed: int, n: int = N) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 5.0, n)
    patterns = np.column_stack([f(k * x) for k in (1, 2) for f in (np.cos, np.sin)])
    nuisances = np.column_stack([np.ones(n), x, rng.normal(size=n)])
    return patterns, nuisances, rng.normal(size=n)


def parts(patterns: np.ndarray, nuisances: np.ndarray, y: np.ndarray, cuts: list[int]) -> list:
    return [
        DenseRows(p, q, t)
        for p, q, t in zip(*(np.split(a, cuts) for a in (patterns, nuisances, y)), strict=True)
    ]


@pytest.mark.parametrize("cuts", [[], [50, 51, 200]])
@pytest.mark.parametrize("lost", [0.0, 30.0])
def test_a_fit_is_least_squares_however_it_is_cut(cuts: list[int], lost: float) -> None:
    patterns, nuisances, y = rows(1)
    found = fit_dense(parts(patterns, nuisances, y, cuts), COLUMNS, freedom_lost=lost)
    z = np.hstack([nuisances, patterns])
    b = np.linalg.lstsq(z, y, rcond=None)[0]
    left = y - z @ b
    variance = left @ left / (N - 7 - lost)
    covariance = variance * np.linalg.inv(z.T @ z)
    np.testing.assert_allclose(found.nuisances, b[:3], atol=1e-9)
    np.testing.assert_allclose(found.patterns, b[3:], atol=1e-9)
    np.testing.assert_allclose(found.residuals, left, atol=1e-9)
    assert found.projected.variance == pytest.approx(variance)
    assert found.projected.freedom == N - 7 - lost
    assert not found.correlated
    assert found.random_variance == 0.0
    np.testing.assert_allclose(found.covariance, covariance[3:, 3:], rtol=1e-7, atol=1e-14)
    np.testing.assert_allclose(found.nuisance_std, np.sqrt(np.diag(covariance)[:3]), rtol=1e-7)
    retained = 1.0 / (np.diag(np.linalg.inv(z.T @ z))[3:] * (patterns**2).sum(axis=0))
    np.testing.assert_allclose(found.projected.retained(), retained, rtol=1e-7)
    np.testing.assert_allclose(found.projected.retained([2]), retained[2:3], rtol=1e-7)
    assert found.projected.rank == 4
    assert found.projected.seen.all()
    assert low_frequency_inflation(found) == 1.0


def test_stated_errors_hold_with_correlated_noise_too() -> None:
    for memory in (0.0, 0.7):
        pulls, slow, correlated = [], [], 0
        for seed in range(120):
            patterns, nuisances, e = rows(seed, 1200)
            fast = np.column_stack([f(k * np.linspace(0, 5, 1200)) for k in (60, 90)
                                    for f in (np.cos, np.sin)])  # fmt: skip
            for k in range(1, e.size):
                e[k] += memory * e[k - 1]
            found = fit_dense(parts(fast, nuisances, e, [600]), COLUMNS)
            pulls.append(found.patterns / np.sqrt(np.diag(found.covariance)))
            found = fit_dense(parts(patterns, nuisances, e, [600]), COLUMNS)
            wide = low_frequency_inflation(found)
            slow.append(found.patterns / np.sqrt(np.diag(found.projected.covariance) * wide))
            correlated += found.correlated
        assert correlated == (120 if memory else 0)
        assert abs(np.mean(pulls)) < 0.15
        assert 0.85 < np.std(pulls) < 1.15
        assert 0.8 < np.std(slow) < 1.15


def test_the_covariance_is_that_of_least_squares_in_noise_of_that_correlation() -> None:
    """By the dense matrices: coefficients, and the degrees of freedom behind the variance."""
    patterns, nuisances, e = rows(3, 800)
    for k in range(1, 800):
        e[k] += 0.8 * e[k - 1]
    found = fit_dense(parts(patterns, nuisances, e, [410]), COLUMNS)
    assert found.correlated
    terms = found.correlation.terms
    assert terms[0] == pytest.approx(0.8, abs=0.08)
    apart = np.abs(np.subtract.outer(np.arange(800), np.arange(800)))
    with_itself = found.correlation.over_lags(800)[apart]
    with_itself[:410, 410:] = with_itself[410:, :410] = 0.0
    z = np.hstack([nuisances, patterns])
    bread = np.linalg.inv(z.T @ z)
    spread = bread @ z.T @ with_itself @ z @ bread
    left = e - z @ bread @ z.T @ e
    variance = left @ left / np.trace(with_itself - z @ bread @ z.T @ with_itself)
    np.testing.assert_allclose(found.residuals, left, atol=1e-9)
    assert found.projected.variance == pytest.approx(variance, rel=1e-6)
    np.testing.assert_allclose(found.covariance, variance * spread[3:, 3:], rtol=1e-6)
    np.testing.assert_allclose(found.nuisance_std**2, variance * np.diag(spread)[:3], rtol=1e-6)
    slow = (1.0 - terms.sum()) ** -2 / (found.correlation.over_lags(1)[0])
    level = np.mean(np.abs(1.0 - terms @ np.exp(-1j * np.outer(np.arange(1, terms.size + 1),
                    np.pi * (np.arange(4096) + 0.5) / 4096))) ** -2)  # fmt: skip
    assert low_frequency_inflation(found) >= 0.999 * slow / level


@pytest.mark.parametrize(("size", "runs"), [(0.0, 12), (3.0, 12), (3.0, 4)])
def test_a_random_term_has_the_variance_that_the_likelihood_says(size: float, runs: int) -> None:
    """Runs with a slope of their own: by the evidence of the dense covariance."""
    rng = np.random.default_rng(4)
    n = 10
    patterns, _, y = rows(5, runs * n)
    ramp = np.tile(np.linspace(-1.0, 1.0, n), runs)
    nuisances = np.zeros((runs * n, 1 + runs))
    nuisances[:, 0] = 1.0
    for j in range(runs):
        part = slice(j * n, (j + 1) * n)
        nuisances[part, 1 + j] = ramp[part]
        y[part] += size * rng.normal() * ramp[part]
    found = fit_dense(parts(patterns, nuisances, y, [30]), COLUMNS, random=range(1, 1 + runs))
    fixed = np.column_stack([np.ones(runs * n), patterns])

    def restricted(variance: float) -> float:
        v = np.eye(runs * n) + variance * nuisances[:, 1:] @ nuisances[:, 1:].T
        inverse = np.linalg.inv(v)
        info = fixed.T @ inverse @ fixed
        left = y - fixed @ np.linalg.solve(info, fixed.T @ inverse @ y)
        freedom = runs * n - 5
        twice = freedom * np.log(left @ inverse @ left / freedom)
        return -0.5 * (twice + np.linalg.slogdet(v)[1] + np.linalg.slogdet(info)[1])

    best = max(np.geomspace(0.1, 100.0, 13), key=restricted)
    if size:
        assert 0.5 < found.random_variance / best < 2.0
        # Averages over the variance, each as probable as the likelihood says, per octave.
        tried = np.geomspace(1e-3, 1e6, 181)
        weights = np.exp([restricted(one) - restricted(best) for one in tried])
        weights /= weights.sum()
        means, covariances = [], []
        for variance in tried:
            v = np.eye(runs * n) + variance * nuisances[:, 1:] @ nuisances[:, 1:].T
            inverse = np.linalg.inv(v)
            spread = np.linalg.inv(fixed.T @ inverse @ fixed)
            means.append((spread @ fixed.T @ inverse @ y)[1:])
            left = y - fixed @ spread @ fixed.T @ inverse @ y
            covariances.append(left @ inverse @ left / (runs * n - 5) * spread[1:, 1:])
        mean = weights @ means
        apart = np.array(means) - mean
        covariance = np.einsum("n,nij->ij", weights, covariances) + (weights * apart.T) @ apart
        # Two variances a decade: a hundredth of an error.
        assert np.abs((found.patterns - mean) / np.sqrt(np.diag(covariance))).max() < 0.02
        np.testing.assert_allclose(np.diag(found.covariance), np.diag(covariance), rtol=0.02)
        assert found.projected.freedom == runs * n - 5
    else:
        assert found.random_variance < 0.1


def test_the_evidence_is_the_restricted_likelihood() -> None:
    """Up to a constant; three runs whose offsets are nearly what a pattern is."""
    rng = np.random.default_rng(8)
    runs, n = 3, 15
    patterns, _, y = rows(9, runs * n)
    patterns = patterns[:, :2]
    nuisances = np.column_stack([np.ones(runs * n), np.kron(np.eye(runs), np.ones((n, 1)))])
    y = y + np.repeat(rng.normal(size=runs), n)
    fixed = np.column_stack([np.ones(runs * n), patterns])
    found, expected = [], []
    for variance in (0.05, 0.5, 5.0, 500.0):
        v = np.eye(runs * n) + variance * nuisances[:, 1:] @ nuisances[:, 1:].T
        inverse = np.linalg.inv(v)
        info = fixed.T @ inverse @ fixed
        left = y - fixed @ np.linalg.solve(info, fixed.T @ inverse @ y)
        freedom = runs * n - 3
        twice = freedom * np.log(left @ inverse @ left / freedom)
        expected.append(-0.5 * (twice + np.linalg.slogdet(v)[1] + np.linalg.slogdet(info)[1]))
        triangle = triangle_of(parts(patterns, nuisances, y, [20]))
        solved = solved_triangle(triangle, 4, 2, [1, 2, 3], variance)
        assert solved.squares(np.eye(2)) == pytest.approx(left @ inverse @ left, rel=1e-9)
        found.append(_evidence(triangle, 4, 2, [1, 2, 3], 45)(variance))
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1e-8)


def test_combinations_that_nothing_shows_take_no_part() -> None:
    patterns, nuisances, y = rows(6)
    twice = np.column_stack([patterns, patterns[:, :1] * 2.0, nuisances[:, 1:2]])
    columns = [*COLUMNS, Unknown("the motor", 1.0, "cos"), Unknown("the ratio", 0.0, "")]
    found = fit_dense(parts(twice, nuisances, y, []), columns)
    projected = found.projected
    assert projected.seen.tolist() == [False, True, True, True, False, False]
    assert projected.rank == 4
    assert projected.retained()[[0, 4, 5]].tolist() == [0.0, 0.0, 0.0]
    alone = fit_dense(parts(patterns, nuisances, y, []), COLUMNS)
    np.testing.assert_allclose(found.residuals, alone.residuals, atol=1e-8)
    assert projected.index("the encoder", 2) == (2, 3)


def test_orders_stand_out_of_their_errors_as_often_as_chance_says() -> None:
    """One in a hundred of noise, of as many orders as are tried."""
    rng = np.random.default_rng(7)
    orders = list(range(1, 11))
    columns = tuple(harmonic_unknowns("a", orders) + harmonic_unknowns("b", orders))
    nothing = Projected(columns, np.eye(40), np.zeros(40), np.ones(40), 1.0, 1.0)
    half = rng.normal(size=(40, 40)) * 0.3 + np.eye(40)
    covariance = half @ half.T
    told = [
        bool(significant_orders(nothing, half @ rng.normal(size=40), covariance, orders, "b"))
        for _ in range(600)
    ]
    assert 1 <= sum(told) <= 16  # of 6, four deviations
    limit = 2.0 * np.log(10 / 0.01)
    for size, kept in ((limit * 0.999, ()), (limit * 1.001, (3,))):
        at = np.zeros(40)
        at[columns.index(Unknown("b", 3.0, "sin"))] = np.sqrt(size)
        assert significant_orders(nothing, at, np.eye(40), orders, "b") == kept
        assert significant_orders(nothing, at, np.eye(40), orders, "a") == ()
