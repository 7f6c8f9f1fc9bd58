"""`_core.Groups` against dense covariances and against every model there is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.linalg import block_diag

import trueangle as ta
from trueangle._core import Evidence, Groups

#: Of some hundred products of order 1 times the condition of the covariance.
SAME = 1e-8

WIDTHS = (1, 2, 3, 1)


def made(seed, runs=3, n=60):
    """Runs with zeros apart, walks and gaps; a second group that is there, and a fourth, alike."""
    rng = np.random.default_rng(seed)
    parts = []
    for r in range(runs):
        x = rng.standard_normal((n, sum(WIDTHS)))
        x[:, 6] = x[:, 0] + 0.3 * x[:, 6]
        t = np.cumsum(rng.uniform(0.2, 1.8, n)) + 40.0 * (np.arange(n) > n // 2)
        y = x[:, 1] - 2.0 * x[:, 2] + x[:, 0] + 3.0 * r + rng.standard_normal(n)
        parts.append((x, y + 0.2 * np.cumsum(rng.standard_normal(n)), t))
    return parts


def dense(parts, noise, tau):
    """Log density and mean of the coefficients, one zero for all; what a run shares is no noise."""
    blocks = []
    for _, _, t in parts:
        apart = np.abs(t[:, None] - t) / np.median(np.diff(t))
        terms = zip(noise[1:], Evidence.CORRELATION_TIMES, strict=True)
        slow = sum(a * np.exp(-apart / s) for a, s in terms)
        blocks.append(noise[0] * np.eye(len(t)) + slow - slow.min())
    x, y = np.vstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    prior = np.repeat(tau, WIDTHS)
    v = block_diag(*blocks) + (x * prior) @ x.T
    inverse = np.linalg.inv(v)
    own, both = inverse.sum(), (inverse @ y).sum()
    square = y @ inverse @ y - both**2 / own
    log = -0.5 * (np.linalg.slogdet(v)[1] + np.log(own) + square)
    mean = prior * (x.T @ inverse @ (y - both / own))
    return log - 0.5 * (len(y) - 1) * np.log(2.0 * np.pi), mean


@pytest.mark.parametrize("seed", range(3))
def test_evidence_and_mean_are_those_of_the_dense_covariance(seed):
    parts, rng = made(seed), np.random.default_rng(seed)
    core = Groups(parts, WIDTHS)
    for tau in itertools.product((0.0, 0.7), repeat=len(WIDTHS)):
        noise = rng.uniform(0.1, 1.0, 6)
        log, mean, covariance = core.sums(noise, 1.0).posterior(tau)
        wanted, there = dense(parts, noise, np.array(tau))
        assert log == pytest.approx(wanted, abs=SAME * abs(wanted))
        np.testing.assert_allclose(mean, there, atol=SAME * (1.0 + np.abs(there).max()))
        assert (np.linalg.eigvalsh(covariance) > -SAME).all()


@pytest.mark.parametrize("seed", range(6))
def test_the_search_finds_the_best_of_all_models_beside_what_is_given(seed):
    parts = made(seed)
    total = float(np.var(np.concatenate([p[1] for p in parts])))
    core = Groups(parts, WIDTHS)
    sums = core.sums(core.noise([1.0] * 4, total), total)
    sizes = total * 10.0 ** (-4.0 + 0.8 * np.arange(7))
    chances = [0.3, 0.2, 0.1, 0.0]
    for given in ([0.0] * 4, [0.0, 0.0, 0.0, 0.5]):
        score, tau = sums.search(given, chances, [0.0] * 4)
        best = -np.inf
        for own in itertools.product((0.0, *sizes), repeat=3):
            model = [*own, given[3]]
            odds = [np.log(p / (1.0 - p) / 7) for p, t in zip(chances, own, strict=False) if t]
            best = max(best, sums.posterior(model)[0] + sum(odds))
        found = sums.posterior(tau)[0]
        found += sum(np.log(p / (1.0 - p) / 7) for p, t in zip(chances[:3], tau, strict=False) if t)
        assert found == pytest.approx(best, abs=1e-6 * abs(best))
        # Of evidence that what is given is integrated over: the same but for its own prior.
        assert score == pytest.approx(found, abs=1e-6 * abs(best))
        assert tau[3] == given[3]


def test_changes_are_differences_of_the_evidence():
    sums = Groups(made(1), WIDTHS).sums([0.8, 0.1, 0.1, 0.1, 0.1, 0.1], 4.0)
    sizes = 4.0 * 10.0 ** (-4.0 + 0.8 * np.arange(7))
    tau = [0.5, 2.0, 0.0, 0.0]
    losses, gains, instead = sums.changes(tau)
    base = sums.posterior(tau)[0]
    for k in (0, 1):
        without = [0.0 if j == k else t for j, t in enumerate(tau)]
        left = sums.posterior(without)[0]
        assert losses[k] == pytest.approx(base - left, abs=1e-7)
        for j in (2, 3):
            best = max(
                sums.posterior([s if i == j else t for i, t in enumerate(without)])[0]
                for s in sizes
            )
            assert instead[k, j] == pytest.approx(best - left, abs=1e-7)
    for j in (2, 3):
        best = max(
            sums.posterior([s if i == j else t for i, t in enumerate(tau)])[0] for s in sizes
        )
        assert gains[j] == pytest.approx(best - base, abs=1e-7)


def test_the_mean_of_a_run_is_an_error_that_a_group_may_hold():
    """Zeros of the runs are no nuisance here: columns that are constant in a run explain them."""
    parts = [
        (np.full((50, 1), float(r)), 10.0 * r + np.cos(np.arange(50.0)), None) for r in range(4)
    ]
    sums = Groups(parts, [1]).sums([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)
    assert sums.posterior([100.0])[1][0] == pytest.approx(10.0, rel=1e-2)


def test_wrong_columns_are_refused():
    x, y = np.zeros((9, 2)), np.zeros(9)
    with pytest.raises(ta.TrueAngleError, match=r"runs\[0\].*columns.*error"):
        Groups([(x[:8], y, None)], [2])
    with pytest.raises(ta.TrueAngleError, match=r"runs\[0\].*columns has 2.*widths has 3"):
        Groups([(x, y, None)], [3])
    with pytest.raises(ta.TrueAngleError, match=r"columns\[5\] must be finite"):
        Groups([(np.where(np.arange(18).reshape(9, 2) == 5, np.nan, 0.0), y, None)], [2])
    core = Groups([(x, y, None)], [1, 1])
    for wrong in ([0.0], [-1.0, 0.0]):
        with pytest.raises(ta.TrueAngleError, match="tau"):
            core.noise(wrong, 1.0)
    with pytest.raises(ta.TrueAngleError, match="scale"):
        core.noise([0.0, 0.0], 0.0)
    with pytest.raises(ta.TrueAngleError, match="white variance"):
        core.sums([0.0] * 6, 1.0)
    with pytest.raises(ta.TrueAngleError, match="probabilities"):
        core.sums([1.0] * 6, 1.0).search([0.0, 0.0], [0.5, 1.0], [0.0, 0.0])
