"""The noise spectrum about the orders: whether what is left is white where it matters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..support.arrays import Array
from ..support.distributions import chi_squared_tail
from .projected import harmonic_rows

#: Distances from an order at which its neighbourhood is looked at.
_BESIDE: Final = (-0.5, -0.41, -0.32, -0.23, 0.23, 0.32, 0.41, 0.5)

#: A louder neighbourhood is believed where chance would make it once in so many orders.
_CHANCE: Final = 1e-3

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
    theta: Array, residuals: Array, orders: Sequence[float], turns: float
) -> Array:
    """Noise power around each order relative to white noise; 1 where it is not louder.

    Only where there are turns enough to look between orders.
    """
    factors = np.ones(len(orders))
    if turns < 6.0:
        return factors
    part = slice(0, _MOST)
    x, e = theta[part], residuals[part]
    near = np.add.outer(np.asarray(orders, dtype=np.float64), _BESIDE)
    power = spectrum_at(x, e, near.ravel()).reshape(near.shape)
    for i, there in enumerate(near > 0.3):
        beside = power[i, there]
        mean = float(beside.mean()) / 2.0
        if chi_squared_tail(float(beside.sum()), 2.0 * beside.size) < _CHANCE:
            factors[i] = max(mean, 1.0)
    return factors
