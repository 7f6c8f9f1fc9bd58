"""Noise beside the orders: whether what is left of the readings is white where it matters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..distributions import chi_squared_tail

__all__ = ["noise_beside", "spectrum_at"]

Array = NDArray[np.float64]

#: Distances from an order at which its neighbourhood is looked at.
_BESIDE: Final = (-0.5, -0.41, -0.32, -0.23, 0.23, 0.32, 0.41, 0.5)

#: A louder neighbourhood is believed where chance would make it once in so many orders.
_CHANCE: Final = 1e-3

#: Readings that are looked at: enough to see 10 %.
_MOST: Final = 200_000


def spectrum_at(theta: Array, values: Array, orders: Array) -> Array:
    r""":math:`2\,|\sum_i e_i \exp(-ik\theta_i)|^2 / \sum e^2`: 2 on average in white noise."""
    total = float(values @ values)
    if total == 0.0:
        return np.zeros(orders.size)
    power = np.zeros(orders.size)
    for i, k in enumerate(orders):
        angle = k * theta
        power[i] = (values @ np.cos(angle)) ** 2 + (values @ np.sin(angle)) ** 2
    return np.asarray(power * (2.0 / total))


def noise_beside(theta: Array, residuals: Array, orders: Sequence[float], turns: float) -> Array:
    """Noise power around each order relative to white noise; 1 where it is not louder.

    Only where there are turns enough to look between orders.
    """
    factors = np.ones(len(orders))
    if turns < 6.0:
        return factors
    part = slice(0, _MOST)
    x, e = theta[part], residuals[part]
    for i, order in enumerate(orders):
        beside = spectrum_at(x, e, np.array([order + d for d in _BESIDE if order + d > 0.3]))
        mean = float(beside.mean()) / 2.0
        if chi_squared_tail(float(beside.sum()), 2.0 * beside.size) < _CHANCE:
            factors[i] = max(mean, 1.0)
    return factors
