"""Variance between units against its closed form, and a slow likelihood of all readings."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad
from scipy.linalg import block_diag
from scipy.optimize import minimize
from scipy.special import digamma, polygamma
from scipy.stats import bartlett, chi2, kstest, multivariate_normal
from statsmodels.regression.mixed_linear_model import MixedLM

from trueangle.errors import ArgumentError
from trueangle.fleets.calibration import order_columns
from trueangle.fleets.tolerance import tolerance_factor, tolerance_of, wilks_units
from trueangle.fleets.units import noise_of
from trueangle.fleets.variance import log_odds_of_mean, reml
from trueangle.support.plainresult import plain_row

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


@pytest.mark.parametrize("n", [2, 5])
def test_the_odds_of_a_mean_are_those_of_the_units_together(n):
    """By scipy: one density of all units, of which any two share the mean's variance."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 5)
    roots = rng.normal(size=(n, 2, 2))
    own = 0.1 * (roots @ roots.transpose(0, 2, 1) + np.eye(2))
    values = rng.normal(1.0, 2.0, (n, 2))
    square = (values**2).mean() - np.trace(own, axis1=1, axis2=2).mean() / 2.0

    def density(share):
        units = (1.0 - share) * np.ones((n, n)) + share * np.eye(n)
        spread = np.kron(square * units, np.eye(2)) + block_diag(*own)
        return multivariate_normal(np.zeros(2 * n), spread).pdf(values.ravel())

    wanted = quad(density, 0.0, 1.0)[0] / density(1.0)
    assert log_odds_of_mean(values, own) == pytest.approx(np.log(wanted), abs=1e-3)


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


UNITS_SEED = 52_300


def test_the_test_of_equal_noise_is_bartletts():
    """With readings whose sums of squares are given, differ where scipy's p is below 1 %."""
    print("seed", UNITS_SEED)
    differed = 0
    for seed in range(150):
        rng = np.random.default_rng([UNITS_SEED, seed])
        sizes = rng.integers(4, 9, int(rng.integers(2, 5)))
        spread = rng.choice([1.0, 3.0])
        readings = [rng.normal(0.0, spread ** rng.normal(), n) for n in sizes]
        squares = np.array([((x - x.mean()) ** 2).sum() for x in readings])
        found = noise_of(squares, sizes - 1.0)
        alike = np.ptp(found.units) == 0.0
        p = bartlett(*readings).pvalue
        # What differs may still be held to one where the logarithms scatter no more than noise.
        assert alike or p < 0.01
        if p < 0.01:
            logs = np.log(squares / (sizes - 1.0)) - digamma((sizes - 1.0) / 2.0)
            logs += np.log((sizes - 1.0) / 2.0)
            more = logs.var(ddof=1) > polygamma(1, (sizes - 1.0) / 2.0).mean()
            assert alike != more
            differed += more
    assert differed > 20


def test_noise_is_held_to_the_common_by_the_moments_of_its_logarithm():
    """Smyth (2004), written out with scipy's functions."""
    print("seed", UNITS_SEED)
    rng = np.random.default_rng(UNITS_SEED + 1)
    freedom = rng.integers(5, 40, 30).astype(float)
    own = 4.0 * 6.0 / rng.chisquare(6.0, 30) * rng.chisquare(freedom) / freedom
    found = noise_of(own * freedom, freedom)
    logs = np.log(own) - digamma(freedom / 2.0) + np.log(freedom / 2.0)
    spread = logs.var(ddof=1) - polygamma(1, freedom / 2.0).mean()
    assert float(polygamma(1, found.freedom / 2.0)) == pytest.approx(spread, rel=1e-9)
    common = np.exp(logs.mean() + digamma(found.freedom / 2.0) - np.log(found.freedom / 2.0))
    assert found.variance == pytest.approx(common, rel=1e-9)
    held = (found.freedom * common + freedom * own) / (found.freedom + freedom)
    assert found.units == pytest.approx(held, rel=1e-9)


def test_units_without_a_difference_are_told_one_noise_as_often_as_said():
    """Of 1000 fleets of 12 units: 1 % are told to differ, to 4.5 standard errors."""
    print("seed", UNITS_SEED)
    rng = np.random.default_rng(UNITS_SEED + 2)
    told = [np.ptp(noise_of(rng.chisquare(6.0, 12), np.full(12, 6.0)).units) > 0.0
            for _ in range(1000)]  # fmt: skip
    assert sum(told) <= 10 + 4.5 * np.sqrt(9.9)


def test_further_noise_is_as_its_degrees_of_freedom_say():
    """Variances of further units over the common one are those of F with the freedom found."""
    print("seed", UNITS_SEED)
    rng = np.random.default_rng(UNITS_SEED + 3)
    true = 9.0 * 5.0 / rng.chisquare(5.0, 4000)
    found = noise_of(true * rng.chisquare(30.0, 4000), np.full(4000, 30.0))
    assert found.freedom == pytest.approx(5.0, rel=0.15)
    assert kstest(found.freedom * found.variance / true, chi2(found.freedom).cdf).pvalue > 1e-3


TOLERANCE_SEED = 52_001


@pytest.mark.parametrize(
    ("n", "share", "confidence", "sides", "published"),
    [
        (10, 0.95, 0.95, 2, 3.393),
        (43, 0.90, 0.99, 2, 2.2228),
        (43, 0.90, 0.99, 1, 1.8740),
        (2, 0.90, 0.95, 1, 20.581),  # ISO 16269-6
        (10, 0.95, 0.95, 1, 2.911),
    ],
)
def test_factors_are_the_published_ones(n, share, confidence, sides, published):
    assert tolerance_factor(n, share, confidence, sides) == pytest.approx(published, abs=6e-4)


@pytest.mark.parametrize("sides", [1, 2])
def test_a_factor_holds_as_often_as_it_says(sides):
    print("seed", TOLERANCE_SEED)
    rng = np.random.default_rng(TOLERANCE_SEED)
    from scipy.stats import norm

    draws = rng.normal(size=(20_000, 12))
    mean, std = draws.mean(axis=1), draws.std(axis=1, ddof=1)
    k = tolerance_factor(12, 0.9, 0.9, sides)
    low = norm.cdf(mean - k * std) if sides == 2 else 0.0
    held = norm.cdf(mean + k * std) - low >= 0.9
    assert held.mean() == pytest.approx(0.9, abs=0.008)


def test_ranks_need_as_many_units_as_wilks_says():
    assert wilks_units(0.95, 0.95, 1) == 59
    assert wilks_units(0.95, 0.95, 2) == 93
    values = np.arange(1.0, 59.0)
    assert tolerance_of(values, values, 0.95, 0.95).method == "normal"
    values = np.arange(1.0, 60.0)
    found = tolerance_of(values, values, 0.95, 0.95)
    assert (found.method, found.peak_to_peak) == ("wilks", 59.0)
    assert tolerance_of(np.arange(1.0, 94.0), np.arange(1.0, 94.0), 0.95, 0.95).peak_to_peak == 92.0


def test_few_units_are_bounded_by_the_scatter_of_their_logarithms():
    """One-sided, with the standard deviation of n - 1."""
    print("seed", TOLERANCE_SEED)
    sizes = np.random.default_rng(TOLERANCE_SEED + 1).lognormal(2.0, 0.4, 10)
    found = tolerance_of(sizes, 0.5 * sizes, 0.9, 0.95)
    assert found.factor == pytest.approx(2.355, abs=6e-4)  # ISO 16269-6, one-sided
    logs = np.log(sizes)
    bound = np.exp(logs.mean() + found.factor * np.sqrt(((logs - logs.mean()) ** 2).sum() / 9.0))
    assert found.peak_to_peak == pytest.approx(bound)
    assert found.left == pytest.approx(0.5 * bound)
    assert plain_row(found, 3600.0)["peak_to_peak_arcsec"] == pytest.approx(3600.0 * bound)


def test_impossible_limits_are_refused():
    with pytest.raises(ArgumentError, match="n must be 2"):
        tolerance_factor(1, 0.9, 0.9)
    with pytest.raises(ArgumentError, match="share must lie"):
        tolerance_factor(5, 1.0, 0.9)
    with pytest.raises(ArgumentError, match="confidence must lie"):
        wilks_units(0.9, 0.0)
    for asked in (tolerance_factor, wilks_units):
        with pytest.raises(ArgumentError, match="sides must be"):
            asked(*((5, 0.9, 0.9, 3) if asked is tolerance_factor else (0.9, 0.9, 3)))
