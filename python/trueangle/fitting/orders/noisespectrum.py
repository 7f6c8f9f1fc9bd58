"""The noise as a smooth function of the order, from what many orders tell of it each.

Noise that remembers the reading before is more at low orders than at high ones. Its spectrum is
smooth; lines are not: an order has to stand out of the noise near it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from ...support.arrays import Array
from ...support.distributions import chi_squared_quantile, chi_squared_tail
from ...support.quantiles import median

#: Orders that tell the noise, at least.
FEWEST_ORDERS: Final = 12

#: Cosines of the order that a spectrum has at most, and orders at least for each coefficient.
_COSINES: Final = 4
_ORDERS_EACH: Final = 4

#: Corners of its power of the order, in parts of the highest: below them it is flat.
_BENDS: Final = (0.0, 0.03, 0.2)

#: Corners of noise that forgets that are looked at, and the lowest order of one.
_CORNERS: Final = 8
_LOWEST: Final = 0.5

#: Belief in all the shapes together that are left out.
_UNBELIEVED: Final = 0.005

#: Beliefs beforehand: white noise, noise that forgets exponentially, any other.
_PRIORS: Final = (0.5, 0.45, 0.05)

#: Degrees of freedom from which a variance counts as known.
_NORMAL: Final = 1e12

#: Chance of noise beyond which what an order tells counts as a line, and no further.
_BEYOND: Final = 0.05

#: Steps of Fisher's scoring, and the change of a logarithm that ends them.
_STEPS: Final = 60
_SETTLED: Final = 1e-4


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
    degrees of freedom of each order resolve that no shape is quite true. 2 to 8 ms.

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
    bend = _bend(freedom)
    clipped = np.maximum(orders, flat_below)
    shapes = _forgetting(orders, flat_below)
    # Where lines may be among those that tell it, each coefficient needs twice as many.
    each = 2 * _ORDERS_EACH if flat_below else _ORDERS_EACH
    shapes += _free(clipped / float(clipped.max()), int(count // each))
    scores = np.empty(len(shapes))
    variances, freedoms = np.empty((2, len(shapes), orders.size))
    for k, (basis, known, prior) in enumerate(shapes):
        found, loss = _fitted(basis[seen], values * np.exp(-known[seen]), bend)
        loss += float(known[seen].sum())
        scores[k] = independent * freedom * loss - 2.0 * math.log(prior)
        scores[k] += basis.shape[1] * math.log(0.5 * freedom * count)
        variances[k] = np.exp(known + basis @ found)
        leverage = basis @ np.linalg.pinv(basis[seen].T @ basis[seen])
        share = np.einsum("ki,ki->k", leverage, basis)
        freedoms[k] = independent * freedom / (bend.widening * share)
    beliefs = np.exp(-0.5 * (scores - scores.min()))
    beliefs /= beliefs.sum()
    # The least believed, of which all together are hardly true, are left out.
    order = np.argsort(beliefs)
    kept = np.sort(order[np.cumsum(beliefs[order]) > _UNBELIEVED])
    white, beliefs = float(beliefs[0]), beliefs[kept] / beliefs[kept].sum()
    return NoiseSpectrum(variances[kept], freedoms[kept], beliefs, white)


class _Shape(NamedTuple):
    """Terms of a logarithm whose coefficients are fitted, what is beside them, and its prior."""

    basis: Array
    known: Array
    prior: float


def _forgetting(orders: Array, flat_below: float) -> list[_Shape]:
    """White noise, and noise that forgets exponentially, seen up to half its sampling or less."""
    highest, level = float(orders.max()), np.ones((orders.size, 1))
    corners = np.geomspace(max(flat_below, _LOWEST), max(highest, 2.0 * flat_below), _CORNERS)
    corners = corners if flat_below else np.append(0.0, corners)
    scale = np.pi / highest
    steps = (scale * orders, 2.0 * np.sin(0.5 * scale * orders))
    found = [-np.log(step**2 + (scale * corner) ** 2) for step in steps for corner in corners]
    prior = _PRIORS[1] / len(found)
    return [
        _Shape(level, np.zeros(orders.size), _PRIORS[0]),
        *(_Shape(level, known, prior) for known in found),
    ]


def _free(share: Array, most: int) -> list[_Shape]:
    """What so many coefficients can follow: cosines of the order, and a power of it."""
    waves = np.cos(np.pi * np.outer(share, np.arange(_COSINES + 1)))
    powers = [np.log(share**2 + corner**2) for corner in _BENDS]
    bases = [waves[:, : 1 + j] for j in range(1, min(_COSINES + 1, most))]
    bases += [
        np.column_stack([waves[:, : 1 + j], power])
        for j in range(min(_COSINES + 1, most - 1))
        for power in powers
    ]
    return [_Shape(basis, np.zeros(share.size), _PRIORS[2] / len(bases)) for basis in bases]


class _Bend(NamedTuple):
    """Where what an order tells is bent, its mean then, and how much wider estimates are."""

    at: float
    mean: float
    widening: float


@lru_cache(maxsize=64)
def _bend(freedom: int) -> _Bend:
    """Of ``min(v, a)`` with v a chi-squared over its freedom, by its moments."""
    x = chi_squared_quantile(1.0 - _BEYOND, freedom)
    at = x / freedom
    low = [1.0 - chi_squared_tail(x, freedom + 2 * power) for power in (1, 2)]
    mean = low[0] + at * _BEYOND
    square = low[1] * (freedom + 2.0) / freedom + at * at * _BEYOND
    variance = square / mean**2 - 1.0
    return _Bend(at, mean, variance / (low[0] / mean) ** 2 * freedom / 2.0)


def _fitted(basis: Array, values: Array, bend: _Bend) -> tuple[Array, float]:
    """Coefficients of the logarithm, and the loss: half the deviance up to a constant."""
    scoring = np.linalg.pinv(basis)
    found = np.zeros(basis.shape[1])
    found[0] = math.log(median(values))
    for _ in range(_STEPS):
        ratio = values * np.exp(-(basis @ found))
        step = scoring @ (np.minimum(ratio, bend.at) / bend.mean - 1.0)
        found += step
        if float(np.abs(step).max()) < _SETTLED:
            break
    log = basis @ found
    ratio = values * np.exp(-log)
    over = np.maximum(ratio / bend.at, 1.0)
    loss = np.minimum(ratio, bend.at) / bend.mean + bend.at / bend.mean * np.log(over)
    return found, float((log + loss).sum())
