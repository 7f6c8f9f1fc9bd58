"""The noise as a smooth function of the order, from what many orders tell of it each.

Noise that remembers the reading before is more at low orders than at high ones. Its spectrum is
smooth; lines are not: an order has to stand out of the noise near it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from ...support.arrays import Array
from ...support.quantiles import median
from .noiseshapes import bend_of, fit_shapes, shapes

#: Orders that tell the noise, at least.
FEWEST_ORDERS: Final = 12

#: Orders at least for each coefficient of a spectrum.
_ORDERS_EACH: Final = 4

#: Belief in all the shapes together that are left out.
_UNBELIEVED: Final = 0.005

#: Degrees of freedom from which a variance counts as known.
_NORMAL: Final = 1e12


class NoiseSpectrum(NamedTuple):
    """Variance of a reading as each order sees it, by every shape of the noise that is believed.

    Attributes
    ----------
    variances, freedoms : ndarray, shape (shapes, orders)
    beliefs : ndarray, shape (shapes,)
        Their sum is 1.
    white : float
        Belief in white noise.
    """

    variances: Array
    freedoms: Array
    beliefs: Array
    white: float = 1.0

    @classmethod
    def flat(cls, variance: float, freedom: float, orders: int) -> NoiseSpectrum:
        """The same at every order."""
        return cls(np.full((1, orders), variance), np.full((1, orders), freedom), np.ones(1))

    @property
    def variance(self) -> Array:
        """What is to be expected at each order: the geometric mean of the shapes."""
        return np.asarray(np.exp(self.beliefs @ np.log(np.maximum(self.variances, 1e-300))))

    def among(self, index: Sequence[int]) -> NoiseSpectrum:
        """Of the orders at these places."""
        places = np.asarray(index, dtype=np.intp)
        return self._replace(variances=self.variances[:, places], freedoms=self.freedoms[:, places])

    def log_chance(self, gain: Array) -> Array:
        """Log of the chance that noise alone reduces the sum of squares by so much.

        ::

            P = Σ_m p_m (1 + T / (s_mk² ν_mk))^(-ν_mk / 2)
        """
        statistic = gain / np.maximum(self.variances, 1e-200)
        parts = np.log(self.beliefs)[:, None] + log_chance(statistic, self.freedoms)
        top = parts.max(axis=0)
        return np.asarray(top + np.log(np.exp(parts - top).sum(axis=0)))


def log_chance(statistic: Array | float, dof: Array | float) -> Array:
    """Logarithm of the probability that noise alone reaches ``statistic``."""
    t = np.maximum(np.asarray(statistic, dtype=np.float64), 0.0)
    v = np.minimum(dof, _NORMAL)
    return np.asarray(-0.5 * v * np.log1p(t / v))


def noise_spectrum(
    orders: Array, told: Array, freedom: int, independent: float = 1.0, flat_below: float = 0.0
) -> NoiseSpectrum | None:
    """The smooth spectrum of noise of which each order tells a variance.

    ::

        s_k² = c                                         white noise,
        s_k² = c / (ω_k² + ω_0²)                         noise that forgets exponentially,
        ln s_k² = c_0 + d ln |ω_k + i ω_0| + Σ_j c_j cos(j ω_k)   any other,

    with ω = π k / K of the highest order K, or 2 sin(ω / 2) where that is half the sampling. The
    first are as likely beforehand as the others together; the last is the exponential model of
    Bloomfield with a power of the order for long memory (Beran). Coefficients have the largest
    likelihood of v_k ~ s_k² χ²_ν / ν; what lies beyond the upper 5 % of noise counts as just that,
    so that lines move it little. Each shape is believed by Schwarz's criterion, and all that are
    make the chance of a line.

    Parameters
    ----------
    orders : ndarray, shape (n,)
    told : ndarray, shape (n,)
        What each order tells; not finite where it tells nothing.
    freedom : int
        Degrees of freedom of each, even.
    independent : float
        Part of them that are independent: less than 1 over part of a turn.
    flat_below : float
        Below this order the spectrum is as at it, where orders that tell the noise may be lines
        themselves. By default 0.

    Returns
    -------
    NoiseSpectrum or None
        None where fewer than a dozen tell it, or readings are copies.

    Notes
    -----
    Of noise that remembers 0.6 or 0.9 of the reading before, the logarithm of s² is off by as
    much as its freedom says (0.7 to 1.2 of its standard error) but at the ends, where 7 and more
    degrees of freedom of each order resolve that no shape is quite true.

    References
    ----------
    P. Bloomfield, An exponential model for the spectrum of a scalar time series, Biometrika 60
    (1973); J. Beran, Fitting long-memory models by generalized linear regression, Biometrika 80
    (1993).
    """
    seen = np.isfinite(told)
    count = independent * np.count_nonzero(seen)
    if count < FEWEST_ORDERS:
        return None
    values = told[seen]
    if not median(values) > 0.0:
        return None
    bend = bend_of(freedom)
    # Where lines may be among those that tell it, each coefficient needs twice as many.
    most = int(count // (2 * _ORDERS_EACH if flat_below else _ORDERS_EACH))
    parts = []
    for shape in shapes(orders.tobytes(), seen.tobytes(), flat_below, most):
        basis, known, prior, scoring, share = shape
        scaled = values * np.exp(-known[:, seen])
        found, loss = fit_shapes(basis[:, seen], scoring, scaled, bend)
        loss = loss + known[:, seen].sum(axis=1)
        size = basis.shape[2]
        score = independent * freedom * loss - 2.0 * np.log(prior)
        score += size * math.log(0.5 * freedom * count)
        variance = np.exp(known + np.einsum("mkp,mp->mk", basis, found))
        parts.append((score, variance, independent * freedom / (bend.widening * share)))
    scores, variances, freedoms = (np.concatenate(part) for part in zip(*parts, strict=True))
    beliefs = np.exp(-0.5 * (scores - scores.min()))
    beliefs /= beliefs.sum()
    # The least believed, of which all together are hardly true, are left out.
    order = np.argsort(beliefs)
    kept = np.sort(order[np.cumsum(beliefs[order]) > _UNBELIEVED])
    white, beliefs = float(beliefs[0]), beliefs[kept] / beliefs[kept].sum()
    return NoiseSpectrum(variances[kept], freedoms[kept], beliefs, white)
