"""The common pattern of units and the variance between them: REML on estimates of known error."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from ..estimation.linear import inverse_and_log_determinant
from ..support.arrays import Array, median

#: Median of the chi-squared distribution of two degrees of freedom, by its half.
_HALF_MEDIAN: Final = float(np.log(2.0))


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


def held_out_score(values: Array, own: Array, variance: float, aligned: bool) -> Array:
    """Logarithm of the density of every unit by the others', the variance taken from all.

    ``values`` and ``own`` are those of `reml`; where the units are ``aligned`` the others' mean
    predicts one, else 0 does.
    """
    spread = own + variance * np.eye(2)
    mean = np.zeros_like(values)
    if aligned:
        inverse, _ = inverse_and_log_determinant(spread)
        every = inverse.sum(axis=0)
        pulls = np.einsum("uij,uj->ui", inverse, values)
        others, _ = inverse_and_log_determinant(every - inverse)
        mean = np.einsum("uij,uj->ui", others, pulls.sum(axis=0) - pulls)
        spread = spread + others
    apart = values - mean
    inverse, logs = inverse_and_log_determinant(spread)
    return np.asarray(-0.5 * (np.einsum("ui,uij,uj->u", apart, inverse, apart) + logs))
