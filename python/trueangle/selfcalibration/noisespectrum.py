"""The noise spectrum about the orders: whether what is left is white where it matters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from ..support.distributions import chi_squared_tail
from .correlation import correlation_above
from .pattern import pattern_series
from .projected import harmonic_rows
from .steady import SteadyFit

#: Distances from an order at which its neighbourhood is looked at.
_BESIDE: Final = (-0.5, -0.41, -0.32, -0.23, 0.23, 0.32, 0.41, 0.5)

#: A louder neighbourhood is believed where chance would make it once in so many orders.
_CHANCE: Final = 1e-3

#: Turns from which it is looked at, and readings over which a spectrum in time is averaged.
_TURNS: Final = 6.0
_LOOKED_AT: Final = 4096

#: Readings that are looked at: enough to see 10 %.
_MOST: Final = 200_000

_CHUNK: Final = 4096


def spectrum_at(theta: Array, values: Array, orders: Array) -> Array:
    """``2 |Σ_i e_i exp(-ikθ_i)|² / Σ e²``: 2 on average in white noise."""
    total = float(values @ values)
    if total == 0.0:
        return np.zeros(orders.size)
    # Harmonics of the whole part of an order times those of the rest, which few share.
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

    An order passes at a frequency that follows the speed: there what the residuals' correlation in
    time says, on average. Where there are turns enough to look between orders, and noise beside an
    order is louder than that, as loud as it is there.

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
    part = slice(None, None, max(1, readings.size // _LOOKED_AT))
    passing = readings.speed[part] * steps[part]
    power = correlation.spectrum(np.multiply.outer(np.asarray(orders, dtype=np.float64), passing))
    if not correlation.is_white:
        # What motion took of the noise is no less where the noise is slow, but more.
        power *= variance / fit.projected.variance
    factors = louder = np.asarray(power.mean(axis=1))
    if sum(stretch.turns for stretch in readings.stretches) >= _TURNS:
        few = slice(0, _MOST)
        louder = louder_beside(x[few], left[few], orders, factors)
    if groups is None:
        return louder
    apart = np.array([power[:, groups[part] == g].mean(axis=1) for g in (0, 1)])
    return np.asarray(louder / factors * apart)


def louder_beside(theta: Array, residuals: Array, orders: Sequence[float], factors: Array) -> Array:
    """``factors``, and of orders beside which noise is louder than these what it is there."""
    found = factors.copy()
    near = np.add.outer(np.asarray(orders, dtype=np.float64), _BESIDE)
    power = spectrum_at(theta, residuals, near.ravel()).reshape(near.shape)
    for i, there in enumerate(near > 0.3):
        beside = power[i, there] / factors[i]
        if chi_squared_tail(float(beside.sum()), 2.0 * beside.size) < _CHANCE:
            found[i] *= max(float(beside.mean()) / 2.0, 1.0)
    return found
