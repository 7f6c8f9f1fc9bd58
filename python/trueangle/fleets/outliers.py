"""Units that do not belong: extreme studentized deviates per order and of the residual."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .variance import robust_variance

#: Probability of a false outlier in a fleet of sound units.
LEVEL: Final = 0.01

#: Shares of that probability: one order of a unit, else all orders together; outliers
#: masked by others (found in a later step, where an earlier one found none), else the others.
_BY_ORDER: Final = 0.9
_HIDDEN: Final = 0.2

#: Shares of the level of those orders of the output in which damage shows: eccentricity and tilt.
_DAMAGE: Final = {1.0: 0.4, 2.0: 0.2}


class Deviates(NamedTuple):
    """How far each unit is from the others.

    Attributes
    ----------
    chance : ndarray, shape (n, K)
        Of a deviate as large or larger, where nothing is the matter.
    size : ndarray, shape (n, K)
        Distance from the others' mean in standard deviations between units.
    unit : ndarray, shape (n,)
        Probability of the unit as a whole, its orders allowed for.
    outlying : ndarray of bool, shape (n,)
    variances : ndarray, shape (K,)
        Between units, by the median.
    limit : float
        Probability of a unit at or below which it is an outlier, unless a quarter of the units are.
    """

    chance: Array
    size: Array
    unit: Array
    outlying: NDArray[np.bool_]
    variances: Array
    limit: float

    def outside(self, unit: int, level: float = LEVEL) -> list[int]:
        """Places of the values in which a unit lies outside, the first the farthest."""
        rows = self.chance[unit]
        limit = level / max(self.chance.size, 1)
        found = [int(k) for k in np.argsort(rows) if rows[k] <= limit]
        return found or [int(np.argmin(rows))]


def level_by_order(orders: Array) -> Array:
    """Shares of the level by order: of damage the most shows in eccentricity, then in tilt.

    Examples
    --------
    >>> level_by_order(np.array([1.0, 2.0, 5.0, 8.0])).round(3).tolist()
    [0.4, 0.2, 0.2, 0.2]
    """
    given = np.array([_DAMAGE.get(float(order), 0.0) for order in orders])
    others = given == 0.0
    given[others] = (1.0 - sum(_DAMAGE.values())) / max(int(others.sum()), 1)
    return np.asarray(given / given.sum())


def deviates(
    values: Sequence[Array],
    own: Sequence[Array],
    aligned: bool,
    level: float = LEVEL,
    shares: Array | None = None,
) -> Deviates:
    """Extreme studentized deviates (Rosner 1983), of several orders together.

    With weights ``w_u = 1/(τ + s_u)``, the mean ``b̄`` of the units that are left
    and ``h_u = w_u / Σ w``,

    ::

        F_u = (e_u / d) / [(Σ_v w_v |b_v - b̄|² - e_u) / (N - d)],
        e_u = w_u |b_u - b̄|² / (1 - h_u),
        N = d (n - 1)

    is Fisher's F with d and N - d degrees of freedom for normal units. A unit's probability is that
    of the smallest of its orders', each over its share of the level (weighted Bonferroni), or of
    all together (Fisher's sum of logarithms). The farthest unit is removed repeatedly. Outliers
    are all units up to the last whose probability, times the number of units then left, is below
    the level, except those that are not significant against the units left.

    Parameters
    ----------
    values : sequence of ndarray, shape (n, d)
        Of every order: cosine and sine (d = 2); or a zero, or the logarithm of a residual (d = 1).
    own : sequence of ndarray, shape (n, d, d)
        Covariance of each.
    aligned : bool
        Whether cosines and sines share a mean; else it is 0. Single numbers always do.
    level : float
        Probability of naming a unit where none is outlying.
    shares : ndarray, shape (K,), optional
        Of the level, by order; they sum to 1. Default: all equal.

    Notes
    -----
    Cost: n times orders for every unit removed, at most a quarter of them and one more.
    """
    n = len(values[0])
    variances = np.array([_variance(v, s, aligned) for v, s in zip(values, own, strict=True)])
    noise = [np.trace(s, axis1=1, axis2=2) / s.shape[1] for s in own]
    weights = [
        1.0 / np.maximum(t + s, 1e-300 + 1e-12 * float(np.mean(v**2)))
        for v, s, t in zip(values, noise, variances, strict=True)
    ]
    share_of = np.full(len(values), 1.0 / len(values)) if shares is None else shares
    inside = np.ones(n, dtype=bool)
    aside: list[int] = []
    last = 0
    # This share of the units and one more can be outliers: they are judged by the others.
    for step in range(1 + int(0.25 * n)):
        unit = _combined(_chances(values, weights, inside, aligned)[0], share_of)
        worst = int(np.argmin(np.where(inside, unit, np.inf)))
        share = _HIDDEN if step > last else 1.0 - _HIDDEN
        if unit[worst] * inside.sum() <= share * level:
            last = step + 1
        elif unit[worst] * inside.sum() >= 1.0 and step > last + 2:
            break
        aside.append(worst)
        inside[worst] = False
    outlying = np.zeros(n, dtype=bool)
    outlying[aside[:last]] = True
    while True:
        chance, size = _chances(values, weights, ~outlying, aligned)
        unit = _combined(chance, share_of)
        limit = (1.0 - _HIDDEN) * level / float((~outlying).sum())
        # A unit removed before a masked one is an outlier only if significant by itself.
        back = outlying & (unit > limit)
        if not back.any():
            return Deviates(chance, size, unit, outlying, variances, limit)
        outlying &= ~back


def _variance(values: Array, own: Array, aligned: bool) -> float:
    if values.shape[1] == 2:
        return robust_variance(values, own, aligned)
    # One dimension: the median square of a normal number is 0.455 of its variance.
    square = float(np.median((values - np.median(values)) ** 2)) / 0.45493642311957283
    return max(square - float(own.mean()), 0.0)


def _chances(
    values: Sequence[Array], weights: Sequence[Array], inside: NDArray[np.bool_], aligned: bool
) -> tuple[Array, Array]:
    """Of every unit and order, by the units inside."""
    chances, sizes = [], []
    for value, weight in zip(values, weights, strict=True):
        d = value.shape[1]
        has_mean = aligned or d == 1
        share = weight * inside
        every = float(share.sum())
        mean = share @ value / every if has_mean else np.zeros(d)
        square = weight * ((value - mean) ** 2).sum(axis=1)
        # Of a unit inside, what the mean took of it; one outside adds the mean's own error.
        leverage = weight / every if has_mean else np.zeros(len(weight))
        apart = np.where(inside, square / np.maximum(1.0 - leverage, 1e-9), square / (1 + leverage))
        freedom = d * (float(inside.sum()) - float(has_mean))
        rest = float((square * inside).sum()) - np.where(inside, apart, 0.0)
        free = np.where(inside, freedom - d, freedom)
        scale = np.maximum(rest, 0.0) / np.maximum(free, 1.0)
        f = np.where(apart > 0.0, apart / d / np.maximum(scale, 1e-300), 0.0)
        # Degrees of freedom of the scale that an order needs: 4.
        chances.append(np.where(free >= 4.0, _f_tail(f, d, np.maximum(free, 1.0)), 1.0))
        sizes.append(np.sqrt(f * d))
    return np.column_stack(chances), np.column_stack(sizes)


def _f_tail(f: Array, d: int, free: Array) -> Array:
    """Tail of F with d = 1 or 2 degrees of freedom above."""
    if d == 2:
        return np.asarray(np.exp(-0.5 * free * np.log1p(2.0 * f / free)))
    from ..support.distributions import student_tail

    pairs = zip(np.sqrt(f).tolist(), free.tolist(), strict=True)
    return np.array([2.0 * student_tail(t, v) for t, v in pairs])


def _combined(chance: Array, shares: Array) -> Array:
    """Probability of a unit by the least of its orders' or by all orders together."""
    orders = chance.shape[1]
    least = (chance / shares).min(axis=1)
    if orders == 1:
        return np.asarray(np.minimum(least, 1.0))
    half = -np.log(np.maximum(chance, 1e-300)).sum(axis=1)  # half of a chi-squared of 2 K
    term, total = np.zeros_like(half), np.zeros_like(half)
    for j in range(orders):
        term = j * np.log(np.maximum(half, 1e-300)) - math.lgamma(j + 1.0)
        total += np.exp(term - half)
    return np.asarray(np.minimum(least / _BY_ORDER, total / (1.0 - _BY_ORDER)).clip(max=1.0))
