"""The last calibration of every unit side by side, its noise, and what units that belong share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..fitting.fit import ROUNDING
from ..joint.shafts import ShaftOrders
from ..support.arrays import Array
from ..support.distributions import (
    chi_squared_quantile,
    chi_squared_tail,
    digamma,
    trigamma,
    trigamma_inverse,
)
from .calibration import Calibration, order_columns, output_orders
from .outliers import Deviates, deviates, level_by_order
from .variance import BetweenUnits, log_odds_of_mean, reml

#: Fewest units for finding outliers: each is compared with the others.
FEWEST: Final = 5

#: Largest share of the units that is rejected as outliers (one may always be).
FEW: Final = 0.05


class Units:
    """The last calibration of every unit, and all dates of those with several."""

    def __init__(
        self, dated: Sequence[Sequence[Calibration]], shafts: list[ShaftOrders], period: float
    ) -> None:
        self.shafts, self.period = shafts, period
        self.orders = output_orders(shafts)
        every = [one for dates in dated for one in dates]
        self.noise: UnitNoise = noise_of(
            np.array([one.squares for one in every]), np.array([one.freedom for one in every])
        )
        louder = louder_orders(every, self.noise.units)
        if (louder > 1.0).any() and all(one.within_freedom for one in every):
            # What runs differ by is in these squares, and no noise of a unit: a few runs draw it.
            self.noise = noise_of(
                np.array([one.within_squares for one in every]),
                np.array([one.within_freedom for one in every]),
            )
            louder = louder_orders(every, self.noise.units)
        self.run_variance = run_variance(every, self.noise.units, louder)
        known = {
            id(one): (replace(one, louder=louder), noise)
            for one, noise in zip(every, self.noise.units.tolist(), strict=True)
        }
        self.dated = [[known[id(one)] for one in dates] for dates in dated]
        self.last = [dates[-1] for dates in self.dated]
        coefficients = np.array([one.coefficients for one, _ in self.last])
        self.coefficients = coefficients
        self.values = [coefficients[:, 2 * k : 2 * k + 2] for k in range(self.orders.size)]
        blocks = np.array([noise * one.blocks() for one, noise in self.last])
        self.own = [np.ascontiguousarray(blocks[:, k]) for k in range(self.orders.size)]
        highest = max(8.0, float(self.orders.max()))
        # Places of a turn for each cycle of the highest order.
        places = np.linspace(0.0, period, int(16 * highest), endpoint=False)
        curves = coefficients @ order_columns(places, self.orders, period).T
        self.peak_to_peak = np.ptp(curves, axis=1)
        self.left = np.sqrt([max(one.squares / one.freedom, 0.0) for one, _ in self.last])
        # Residuals are compared by their logarithms; below rounding these are of nothing.
        self.log_left = np.log(np.maximum(self.left, ROUNDING * period))[:, None]
        freedom = np.array([one.freedom for one, _ in self.last])
        self.log_left_own = 0.25 * trigamma(0.5 * freedom)[:, None, None]


class SharedPattern(NamedTuple):
    """What the units that belong share, with or without a mean.

    ``probability`` is that of a mean that is not zero.
    ``belong`` are the units that are no outliers; all of them where more are outliers than
    `FEW` allows: these are the tails of the design, of which the next unit may be one.
    """

    probability: float
    deviates: Deviates
    belong: NDArray[np.bool_]
    between: list[BetweenUnits]


def shared_pattern(units: Units) -> SharedPattern:
    """Outliers, and mean and variance of the others; the mean is zero where that is more probable.

    Both choices are compared on the same units: those that neither of them calls an outlier. An
    outlier that only one of them detects would else decide for all.
    """
    n = len(units.last)
    # The residual has the share of an order that shows no damage.
    shares = level_by_order(np.append(units.orders, 0.0))
    choices = (False, True) if n > 1 else (False,)
    values, own = [*units.values, units.log_left], [*units.own, units.log_left_own]
    found = {aligned: deviates(values, own, aligned, shares=shares) for aligned in choices}
    judged = ~np.any([one.outlying for one in found.values()], axis=0) | (n < FEWEST)
    pairs = list(zip(units.values, units.own, strict=True))
    odds = sum(log_odds_of_mean(v[judged], s[judged]) for v, s in pairs) if n > 1 else 0.0
    probability = float(np.exp(-np.logaddexp(0.0, -odds)))
    aligned = probability > 0.5
    chosen = found[aligned]._replace(outlying=found[aligned].outlying & (n >= FEWEST))
    few = chosen.outlying.sum() <= max(1.0, FEW * n)
    kept = ~chosen.outlying if few else np.ones(n, dtype=bool)
    between = [reml(values[kept], own[kept], aligned) for values, own in pairs]
    return SharedPattern(probability, chosen, kept, between)


#: Level at which units are found to differ in their noise.
_LEVEL: Final = 0.01


def louder_orders(calibrations: Sequence[Calibration], noise: Array) -> Array:
    """Variance of coefficients between runs of one unit over that of independent readings.

    Of all units together, by order; 1 where it is no greater at 1 %. What drifts within a run, or
    correlates along it, differs between runs, and is not in what single readings scatter by.
    """
    squares = np.sum([one.repeat_squares for one in calibrations], axis=0)
    white = np.sum(
        [s * one.repeat_white for s, one in zip(noise.tolist(), calibrations, strict=True)], axis=0
    )
    freedom = sum(one.repeat_freedom for one in calibrations)
    found = np.ones(squares.size)
    if not freedom:
        return found
    limit = chi_squared_quantile(1.0 - _LEVEL / found.size, freedom) / freedom
    ratio = np.divide(squares, white, out=np.ones(squares.size), where=white > 0.0)
    return np.where(ratio > limit, ratio, found)


def run_variance(calibrations: Sequence[Calibration], noise: Array, louder: Array) -> Array | None:
    """Variance of single runs' coefficients about their unit's that no noise of readings makes.

    Of cosine and sine of each order; None where no order is louder.
    """
    freedom = sum(one.repeat_freedom for one in calibrations)
    if not (louder > 1.0).any():
        return None
    more = [
        one.repeat_squares - share * one.repeat_white
        for one, share in zip(calibrations, noise.tolist(), strict=True)
    ]
    excess = np.where(louder > 1.0, np.sum(more, axis=0) / freedom, 0.0)
    return np.repeat(np.maximum(excess, 0.0), 2)


class UnitNoise(NamedTuple):
    """Variance of a reading, of every unit, and what a further unit's is like.

    ``variance`` is that of all units together, ``freedom`` its degrees of freedom as a
    prediction for a further unit (infinite where units do not differ).
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
    logs = np.log(own) - digamma(0.5 * freedom) + np.log(0.5 * freedom)
    spread = float(logs.var(ddof=1) - trigamma(0.5 * freedom).mean())
    if not spread > 0.0:
        return UnitNoise(np.full(len(own), pooled), pooled, math.inf)
    prior = float(2.0 * trigamma_inverse(spread))
    common = math.exp(float(logs.mean() + digamma(0.5 * prior)) - math.log(0.5 * prior))
    held = (prior * common + freedom * own) / (prior + freedom)
    return UnitNoise(np.asarray(held), common, prior)
