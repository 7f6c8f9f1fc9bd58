"""Variance between units against its closed form, and a slow likelihood of all readings."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal
from statsmodels.regression.mixed_linear_model import MixedLM

from trueangle.fleets.calibration import order_columns
from trueangle.fleets.units import noise_of
from trueangle.fleets.variance import held_out_score, reml

SEED = 52_010


def test_of_balanced_units_it_is_that_of_the_variance_table():
    """Analysis of variance is restricted likelihood where all is balanced."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    values = rng.normal(3.0, 2.0, (30, 2))
    own = np.broadcast_to(0.25 * np.eye(2), (30, 2, 2))
    found = reml(values, own, aligned=True)
    between = ((values - values.mean(axis=0)) ** 2).sum() / (2.0 * 29.0)
    assert found.mean == pytest.approx(values.mean(axis=0), rel=1e-12)
    assert found.variance == pytest.approx(between - 0.25, rel=1e-9)
    assert found.covariance == pytest.approx(np.eye(2) * between / 30.0, rel=1e-9)
    alone = reml(values, own, aligned=False)
    assert alone.variance == pytest.approx((values**2).sum() / 60.0 - 0.25, rel=1e-9)


def test_of_readings_it_is_the_mixed_models_restricted_likelihood():
    """As a mixed model of all readings gives it, noise estimated beside: balanced, one noise."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    units, n = 12, 16
    design = order_columns(np.arange(n) * 22.5, np.array([1.0]), 360.0)
    own = rng.normal([4.0, -2.0], 1.5, (units, 2))
    readings = own @ design.T + rng.normal(0.0, 0.8, (units, n))

    def minus_likelihood(logs):
        tau, noise = np.exp(logs)
        spread = noise * np.eye(n) + tau * design @ design.T
        inverse = np.linalg.inv(spread)
        information = units * design.T @ inverse @ design
        mean = np.linalg.solve(information, design.T @ inverse @ readings.sum(axis=0))
        left = readings - design @ mean
        squares = np.einsum("ui,ij,uj->", left, inverse, left)
        log_spread = units * np.linalg.slogdet(spread)[1]
        return 0.5 * (log_spread + squares + np.linalg.slogdet(information)[1])

    options = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}
    slow = minimize(minus_likelihood, [0.0, 0.0], method="Nelder-Mead", options=options)
    estimates = readings @ design / (n / 2.0)
    squares = ((readings - estimates @ design.T) ** 2).sum(axis=1)
    noise = noise_of(squares, np.full(units, n - 2.0))
    inverse = np.broadcast_to(np.eye(2) / (n / 2.0), (units, 2, 2))
    found = reml(estimates, noise.units[:, None, None] * inverse, aligned=True)
    assert found.variance == pytest.approx(np.exp(slow.x[0]), rel=1e-4)
    assert noise.variance == pytest.approx(np.exp(slow.x[1]), rel=1e-4)


@pytest.mark.parametrize("seed", [SEED + 10, SEED + 11])
def test_of_readings_it_is_statsmodels_mixed_model(seed):
    """Mean, variance between units and noise of balanced readings, by another implementation."""
    print("seed", seed)
    rng = np.random.default_rng(seed)
    units, n = 15, 24
    design = order_columns(np.arange(n) * 15.0, np.array([1.0]), 360.0)
    own = rng.normal([4.0, -2.0], 1.5, (units, 2))
    readings = own @ design.T + rng.normal(0.0, 0.8, (units, n))
    table = pd.DataFrame(
        {
            "error": readings.ravel(),
            "cosine": np.tile(design[:, 0], units),
            "sine": np.tile(design[:, 1], units),
            "unit": np.repeat(np.arange(units), n),
        }
    )
    mixed = MixedLM.from_formula(
        "error ~ 0 + cosine + sine",
        groups="unit",
        re_formula="0",
        vc_formula={"pattern": "0 + cosine + sine"},
        data=table,
    ).fit(reml=True)
    estimates = readings @ design / (n / 2.0)
    squares = ((readings - estimates @ design.T) ** 2).sum(axis=1)
    noise = noise_of(squares, np.full(units, n - 2.0))
    inverse = np.broadcast_to(np.eye(2) / (n / 2.0), (units, 2, 2))
    found = reml(estimates, noise.units[:, None, None] * inverse, aligned=True)
    assert found.mean == pytest.approx(mixed.fe_params.to_numpy(), rel=1e-4)
    assert found.variance == pytest.approx(float(mixed.vcomp[0]), rel=1e-4)
    assert noise.variance == pytest.approx(float(mixed.scale), rel=1e-4)
    spread = np.diag(mixed.cov_params().to_numpy())[:2]
    assert np.diag(found.covariance) == pytest.approx(spread, rel=1e-4)


def test_of_unbalanced_units_it_is_the_greatest_likelihood():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    roots = rng.normal(size=(25, 2, 2))
    own = roots @ roots.transpose(0, 2, 1)
    values = np.array([rng.multivariate_normal([1.0, 2.0], s + 0.7 * np.eye(2)) for s in own])

    def minus_likelihood(tau):
        inverse = np.linalg.inv(own + tau * np.eye(2))
        information = inverse.sum(axis=0)
        mean = np.linalg.solve(information, np.einsum("uij,uj->i", inverse, values))
        squares = np.einsum("ui,uij,uj->", values - mean, inverse, values - mean)
        logs = np.linalg.slogdet(information)[1] - np.linalg.slogdet(inverse)[1].sum()
        return 0.5 * (squares + logs)

    found = reml(values, own, aligned=True)
    best = minus_likelihood(found.variance)
    for factor in (0.99, 1.01):
        assert minus_likelihood(factor * found.variance) > best


def test_units_without_a_difference_have_none():
    values = np.full((6, 2), 2.0) + 1e-3 * np.arange(12.0).reshape(6, 2)
    own = np.broadcast_to(np.eye(2), (6, 2, 2))
    assert reml(values, own, aligned=True).variance == 0.0


def test_held_out_units_tell_whether_there_is_a_mean():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 3)
    own = np.broadcast_to(0.01 * np.eye(2), (20, 2, 2))
    for mean, better in ((0.0, False), (2.0, True)):
        values = rng.normal(mean, 1.0, (20, 2))
        scores = [
            held_out_score(values, own, reml(values, own, aligned).variance, aligned).sum()
            for aligned in (False, True)
        ]
        assert (scores[1] > scores[0]) == better


@pytest.mark.parametrize("aligned", [False, True])
def test_the_score_of_a_held_out_unit_is_its_density_by_the_others(aligned):
    """By scipy, one after another: its own error, that between units, that of the others' mean."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 5)
    roots = rng.normal(size=(7, 2, 2))
    own = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(2)
    values, variance = rng.normal(1.0, 2.0, (7, 2)), 0.6
    wanted = []
    for u in range(7):
        mean, unsure = np.zeros(2), np.zeros((2, 2))
        if aligned:
            rest = [np.linalg.inv(own[v] + variance * np.eye(2)) for v in range(7) if v != u]
            unsure = np.linalg.inv(sum(rest))
            mean = unsure @ sum(
                w @ x for w, x in zip(rest, np.delete(values, u, axis=0), strict=True)
            )
        spread = own[u] + variance * np.eye(2) + unsure
        wanted.append(multivariate_normal(mean, spread).logpdf(values[u]) + np.log(2.0 * np.pi))
    found = held_out_score(values, own, variance, aligned)
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_noise_that_differs_is_each_units_own_but_held_to_the_common():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 4)
    freedom = np.full(40, 8.0)
    true = np.where(np.arange(40) < 20, 1.0, 25.0)
    own = true * rng.chisquare(8.0, 40)
    found = noise_of(own, freedom)
    assert np.isfinite(found.freedom)
    assert np.log(found.units).std() < np.log(own / freedom).std()
    same = noise_of(rng.chisquare(8.0, 40), freedom)
    assert np.ptp(same.units) == 0.0
