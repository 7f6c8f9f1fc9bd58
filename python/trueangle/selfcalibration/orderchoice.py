"""Choice of orders: found in the residuals, kept by their significance and the noise about them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..estimation.linear import wald_statistic
from ..support.arrays import Array
from ..support.distributions import chi_squared_quantile, chi_squared_tail
from .correlation import correlation_above
from .model import ENCODER, pattern_series
from .projected import Projected, harmonic_rows
from .segments import SegmentReadings
from .steady import SteadyFit, fit_steady

#: Highest order looked for.
HIGHEST: Final = 128


#: Readings that are looked at: enough to see 10 %.
_MOST: Final = 200_000

_CHUNK: Final = 4096


def highest_order(readings: SegmentReadings) -> int:
    """Highest order that is read at least twice per wave at the usual speed."""
    usual = float(np.median(readings.speed))
    step = float(np.median(np.diff(readings.time)[np.diff(readings.stretch) == 0]))
    return max(1, min(HIGHEST, int(0.45 / (usual * max(step, 1e-12)))))


def choose_selfcal_orders(readings: SegmentReadings) -> tuple[float, ...]:
    """Orders that are significant against the noise near them.

    The lowest eight are fitted first, then those at which the residual peaks, until none
    does; at last those that are not significant are dropped.
    """
    most = highest_order(readings)
    orders = tuple(float(k) for k in range(1, min(8, most) + 1))
    limit = _limit(most)
    fit: SteadyFit | None = None
    stride = max(1, readings.size // 100_000)
    for _ in range(5):
        fit = fit_steady(readings, orders, start=fit, thorough=False, smooth=True)
        good = np.flatnonzero(fit.valid)[:100_000] if stride == 1 else _runs(fit.valid)
        theta = readings.angle[good] - _series(fit, good)
        others = np.array([k for k in range(1, most + 1) if k not in orders], dtype=np.float64)
        if others.size == 0:
            break
        power = spectrum_at(theta, fit.residuals[good], others)
        beside = spectrum_at(theta, fit.residuals[good], others + 0.37)
        level = np.maximum(1.0, _running_mean(beside / 2.0))
        new = others[power / level > limit]
        if new.size == 0:
            break
        orders = tuple(sorted({*orders, *(float(k) for k in new)}))
    assert fit is not None
    if fit.orders != orders:
        fit = fit_steady(readings, orders, start=fit, thorough=False, smooth=True)
    return significant_orders(
        fit.projected, fit.unknowns, fit.projected.covariance, orders, ENCODER, most
    )


def _limit(tried: int) -> float:
    # Probability of taking up any order that is not there.
    return chi_squared_quantile(1.0 - 0.01 / max(tried, 1), 2.0)


def _series(fit: SteadyFit, rows: NDArray[np.intp]) -> Array:
    angle = fit.readings.angle[rows]
    return pattern_series(fit.orders, fit.pattern, angle)


def _runs(valid: NDArray[np.bool_]) -> NDArray[np.intp]:
    """A hundred pieces of a thousand neighbours, over the whole log."""
    starts = np.linspace(0, valid.size - 1000, 100).astype(np.int64)
    rows = (starts[:, None] + np.arange(1000)).ravel()
    return np.unique(rows[valid[rows]])


def _running_mean(values: Array) -> Array:
    kernel = np.ones(min(9, values.size))
    return np.asarray(
        np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")
    )


def significant_orders(
    projected: Projected,
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    among: Sequence[float],
    source: str | None = None,
    tried: int | None = None,
) -> tuple[float, ...]:
    """Orders of ``among`` whose cosine and sine are jointly significant, of ``tried`` orders."""
    limit = _limit(len(among) if tried is None else tried)
    kept = []
    for order in among:
        at = [
            i
            for i, column in enumerate(projected.columns)
            if column.order == order and column.part and source in (None, column.source)
        ]
        if wald_statistic(coefficients[at], covariance[np.ix_(at, at)]) > limit:
            kept.append(order)
    return tuple(kept)


def spectrum_at(theta: Array, values: Array, orders: Array) -> Array:
    """``2 |Σ_i e_i exp(-ikθ_i)|² / Σ e²``: 2 on average in white noise."""
    total = float(values @ values)
    if total == 0.0:
        return np.zeros(orders.size)
    # Harmonics of the integer part of an order times those of the fraction: few are distinct.
    whole = np.unique(np.floor(orders))
    rests, which = np.unique(np.round(orders - np.floor(orders), 9), return_inverse=True)
    place = np.searchsorted(whole, np.floor(orders))
    found = np.zeros((2 * whole.size, 2 * rests.size))
    for a in range(0, theta.size, _CHUNK):
        x, e = theta[a : a + _CHUNK], values[a : a + _CHUNK]
        beside = rests[:, None] * x
        both = np.concatenate([e * np.cos(beside), e * np.sin(beside)])
        found += harmonic_rows(x, whole.tolist()) @ both.T
    cosine, sine = found[0::2], found[1::2]
    n = rests.size
    real = cosine[place, which] - sine[place, which + n]
    imaginary = sine[place, which] + cosine[place, which + n]
    return np.asarray((real**2 + imaginary**2) * (2.0 / total))


def noise_spectrum_at(
    fit: SteadyFit, orders: Sequence[float], groups: NDArray[np.int64] | None = None
) -> Array:
    """Noise power at each order relative to white noise.

    An order appears at a frequency proportional to the speed: the power there follows, on average,
    from the residuals' correlation in time. Where there are enough turns to resolve the spectrum
    between orders, and the noise next to an order is stronger than that, its power is used.

    Returns
    -------
    ndarray, shape (orders,), or (2, orders) of readings in groups 0 and 1
    """
    readings = fit.readings
    x = readings.angle - pattern_series(fit.orders, fit.pattern, readings.angle)
    left = np.where(fit.valid, fit.residuals, 0.0)
    series, steps = [], np.zeros(readings.size)
    for i in range(len(readings.stretches)):
        rows = readings.stretch == i
        series.append(left[rows][:_MOST])
        steps[rows] = np.median(np.diff(readings.time[rows]))
    cut = fit.motion.fastest * float(np.median(steps))
    correlation, variance = correlation_above(series, cut)
    part = slice(None, None, max(1, readings.size // 4096))
    passing = readings.speed[part] * steps[part]
    power = correlation.spectrum(np.multiply.outer(np.asarray(orders, dtype=np.float64), passing))
    if not correlation.is_white:
        # Motion removes more of the noise, not less, where the noise is slow.
        power *= variance / fit.projected.variance
    factors = louder = np.asarray(power.mean(axis=1))
    if sum(stretch.turns for stretch in readings.stretches) >= 6.0:
        few = slice(0, _MOST)
        louder = louder_beside(x[few], left[few], orders, factors)
    if groups is None:
        return louder
    apart = np.array([power[:, groups[part] == g].mean(axis=1) for g in (0, 1)])
    return np.asarray(louder / factors * apart)


def louder_beside(theta: Array, residuals: Array, orders: Sequence[float], factors: Array) -> Array:
    """``factors``; where the noise next to an order is stronger, its power instead."""
    found = factors.copy()
    # Distances from an order at which its neighbourhood is looked at.
    near = np.add.outer(
        np.asarray(orders, dtype=np.float64), (-0.5, -0.41, -0.32, -0.23, 0.23, 0.32, 0.41, 0.5)
    )
    power = spectrum_at(theta, residuals, near.ravel()).reshape(near.shape)
    for i, there in enumerate(near > 0.3):
        beside = power[i, there] / factors[i]
        # P-value below which noise next to an order counts as stronger than at the order.
        if chi_squared_tail(float(beside.sum()), 2.0 * beside.size) < 1e-3:
            found[i] *= max(float(beside.mean()) / 2.0, 1.0)
    return found
