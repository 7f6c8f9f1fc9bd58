"""The noise of readings, unit by unit, and how much units differ in it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.distributions import chi_squared_tail

__all__ = ["UnitNoise", "noise_of"]

Array = NDArray[np.float64]

#: Level at which units are found to differ in their noise.
_LEVEL: Final = 0.01


class UnitNoise(NamedTuple):
    """Variance of a reading, of every unit, and what a further unit's is like.

    ``variance`` is that of all units together, ``freedom`` the degrees of freedom that it is worth
    as a guess of a further unit's (infinite where units do not differ).
    """

    units: Array
    variance: float
    freedom: float


def noise_of(squares: Array, freedom: Array) -> UnitNoise:
    """One variance for all units where Bartlett's test finds no difference at 1 %.

    Else each unit's own, held to the common one by ``d₀`` degrees of freedom,

    ::

        s̃_u² = (d₀ s₀² + ν_u s_u²) / (d₀ + ν_u),

    with ``d₀, s₀`` from the mean and variance of ``log s_u²`` (Smyth 2004).

    Parameters
    ----------
    squares, freedom : ndarray, shape (n,)
        Sum of squares left of each unit's readings, and its degrees of freedom.

    Examples
    --------
    >>> found = noise_of(np.array([50.0, 60.0]), np.array([10.0, 10.0]))
    >>> found.units.tolist(), found.freedom
    ([5.5, 5.5], inf)
    """
    pooled = float(squares.sum() / freedom.sum())
    own = squares / freedom
    if len(own) < 2 or not (own > 0.0).all():
        return UnitNoise(np.full(len(own), pooled), pooled, math.inf)
    statistic = float(freedom.sum() * math.log(pooled) - (freedom * np.log(own)).sum())
    few = (float((1.0 / freedom).sum()) - 1.0 / float(freedom.sum())) / (3.0 * (len(own) - 1.0))
    if chi_squared_tail(max(statistic / (1.0 + few), 0.0), len(own) - 1.0) >= _LEVEL:
        return UnitNoise(np.full(len(own), pooled), pooled, math.inf)
    logs = np.log(own) - np.array([_digamma(0.5 * v) - math.log(0.5 * v) for v in freedom])
    spread = float(logs.var(ddof=1)) - float(np.mean([_trigamma(0.5 * v) for v in freedom]))
    prior = 2.0 * _trigamma_inverse(spread) if spread > 0.0 else math.inf
    if math.isinf(prior):
        return UnitNoise(np.full(len(own), pooled), pooled, math.inf)
    common = math.exp(float(logs.mean()) + _digamma(0.5 * prior) - math.log(0.5 * prior))
    held = (prior * common + freedom * own) / (prior + freedom)
    return UnitNoise(np.asarray(held), common, prior)


def _digamma(x: float) -> float:
    """By recurrence to 10 and the asymptotic series, to 1e-12."""
    found = 0.0
    while x < 10.0:
        found -= 1.0 / x
        x += 1.0
    square = 1.0 / (x * x)
    series = square * (1 / 12 - square * (1 / 120 - square * (1 / 252 - square / 240)))
    return found + math.log(x) - 0.5 / x - series


def _trigamma(x: float) -> float:
    """By recurrence to 10 and the asymptotic series, to 1e-12."""
    found = 0.0
    while x < 10.0:
        found += 1.0 / (x * x)
        x += 1.0
    square = 1.0 / (x * x)
    series = square * (1 / 6 - square * (1 / 30 - square * (1 / 42 - square / 30)))
    return found + (1.0 + 0.5 / x + series) / x


def _trigamma_inverse(value: float) -> float:
    """The x whose trigamma is ``value``, by halving."""
    low, high = 1e-6, 1e8
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _trigamma(middle) > value else (low, middle)
    return math.sqrt(low * high)
