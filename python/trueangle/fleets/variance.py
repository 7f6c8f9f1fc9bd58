"""The common pattern of units and the variance between them: REML on estimates of known error."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from ..estimation.linear import inverse_and_log_determinant
from ..support.arrays import Array, median

#: Median of the chi-squared distribution of two degrees of freedom, by its half.
_HALF_MEDIAN: Final = float(np.log(2.0))

#: Points and weights of Gauss from 0 to 1.
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(24) + np.array([[1.0], [0.0]])) / 2.0


class BetweenUnits(NamedTuple):
    """Mean of the units, its covariance, and the variance between units of cosine and sine."""

    mean: Array
    covariance: Array
    variance: float


def robust_variance(values: Array, own: Array, aligned: bool) -> float:
    """Variance between units by the median square, which a half of outliers does not move.

    ``values`` (n, 2) have the covariances ``own``; units that are ``aligned`` share a mean, else it
    is 0.
    """
    centre = np.median(values, axis=0) if aligned else np.zeros(2)
    squares = ((values - centre) ** 2).sum(axis=1)
    noise = float(np.mean(np.trace(own, axis1=1, axis2=2))) / 2.0
    return max(float(median(squares)) / (2.0 * _HALF_MEDIAN) - noise, 0.0)


def reml(values: Array, own: Array, aligned: bool) -> BetweenUnits:
    """Mean and variance between units, by restricted maximum likelihood.

    ::

        b_u ~ N(μ, τ I + S_u),
        l = -1/2 Σ_u [log|V_u| + r_u' V_u⁻¹ r_u] - 1/2 log|Σ_u V_u⁻¹|

    by Fisher's scoring in ``τ ≥ 0``; by maximum likelihood if not ``aligned``.

    Parameters
    ----------
    values : ndarray, shape (n, 2)
        Cosine and sine of one order of every unit.
    own : ndarray, shape (n, 2, 2)
        Covariance of each.
    aligned : bool
        Whether the mean is free; else it is 0.

    Returns
    -------
    Between

    Examples
    --------
    >>> rng = np.random.default_rng(3)
    >>> found = reml(rng.normal(5.0, 2.0, (4000, 2)), np.zeros((4000, 2, 2)), aligned=True)
    >>> found.mean.round(), round(found.variance)
    (array([5., 5.]), 4)
    """
    tau = max(robust_variance(values, own, aligned), 1e-12 * float(np.mean(values**2)) + 1e-300)
    best = _score(values, own, aligned, tau)
    # Steps at most; it ends by their relative change.
    for _ in range(200):
        step = best.score / best.information
        # A step never crosses zero: half the way to it is taken.
        further = tau + step if tau + step > 0.5 * tau else 0.5 * tau
        if abs(further - tau) <= 1e-12 * tau:
            break
        tau = further
        best = _score(values, own, aligned, tau)
    edge = _score(values, own, aligned, 0.0) if np.linalg.det(own).min() > 0.0 else None
    if edge is not None and edge.likelihood >= best.likelihood:
        tau, best = 0.0, edge
    return BetweenUnits(best.mean, best.covariance, tau)


class _Likelihood(NamedTuple):
    score: float
    information: float
    likelihood: float
    mean: Array
    covariance: Array


def _score(values: Array, own: Array, aligned: bool, tau: float) -> _Likelihood:
    inverse, logs = inverse_and_log_determinant(own + tau * np.eye(2))
    with np.errstate(over="ignore"):  # of units without noise
        squared = inverse @ inverse
    mean, covariance = np.zeros(2), np.zeros((2, 2))
    likelihood = -0.5 * float(logs.sum())
    if aligned:
        covariance, log = inverse_and_log_determinant(inverse.sum(axis=0))
        likelihood -= 0.5 * float(log)
        mean = covariance @ np.einsum("uij,uj->i", inverse, values)
    apart = np.einsum("uij,uj->ui", inverse, values - mean)
    trace = float(np.einsum("uii->", inverse))
    second = float(np.einsum("uij,uji->", inverse, inverse))
    likelihood -= 0.5 * float(np.einsum("ui,ui->", apart, values - mean))
    if aligned:
        both = covariance @ squared.sum(axis=0)
        trace -= float(np.trace(both))
        second -= 2.0 * float(np.trace(covariance @ (squared @ inverse).sum(axis=0)))
        second += float(np.trace(both @ both))
    score = 0.5 * (float((apart**2).sum()) - trace)
    return _Likelihood(score, max(0.5 * second, 1e-300), likelihood, mean, covariance)


def log_odds_of_mean(values: Array, own: Array) -> float:
    """Logarithm of the odds that the units share a mean, by one order; even before.

    ::

        b_u ~ N(μ, ρ v I + S_u),    μ ~ N(0, (1 - ρ) v I)

    ``ρ`` is 1 where phases are random, and uniform from 0 to 1 where the units share a mean;
    ``v`` is the mean square of cosine and sine less that of the noise in both.

    Parameters
    ----------
    values : ndarray, shape (n, 2)
        Cosine and sine of the order of every unit.
    own : ndarray, shape (n, 2, 2)
        Covariance of each.
    """
    noise = float(np.mean(np.trace(own, axis1=1, axis2=2))) / 2.0
    square = float(np.mean(values**2)) - noise
    if square <= 0.0:
        return 0.0
    several = [
        math.log(weight) + _log_density(values, own, share * square, (1.0 - share) * square)
        for share, weight in zip(_NODES, _WEIGHTS, strict=True)
    ]
    return float(np.logaddexp.reduce(several)) - _log_density(values, own, square, 0.0)


def _log_density(values: Array, own: Array, between: float, of_mean: float) -> float:
    """Of units about a mean of the variance ``of_mean`` about zero."""
    inverse, logs = inverse_and_log_determinant(own + between * np.eye(2))
    pulls = np.einsum("uij,uj->ui", inverse, values)
    pull = pulls.sum(axis=0)
    shrunk, log = inverse_and_log_determinant(np.eye(2) + of_mean * inverse.sum(axis=0))
    squares = float((values * pulls).sum() - of_mean * (pull @ shrunk @ pull))
    return -0.5 * (squares + float(logs.sum() + log))
