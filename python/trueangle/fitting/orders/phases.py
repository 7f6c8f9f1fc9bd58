"""Phases of orders, run by run, and the circular range that holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...support.arrays import Array
from .chosen import fit_chosen_orders
from .harmonicsums import HarmonicSums


def circular_range_deg(phases: ArrayLike) -> float:
    """Smallest arc in degrees that holds all phases (radians); NaN for fewer than two.

    Examples
    --------
    >>> round(circular_range_deg(np.radians([355.0, 5.0, 1.0])), 6)
    10.0
    """
    found = np.asarray(phases, dtype=np.float64)
    found = np.sort(np.mod(found[np.isfinite(found)], 2.0 * math.pi))
    if found.size < 2:
        return math.nan
    gaps = np.diff(found, append=found[0] + 2.0 * math.pi)
    return float(np.degrees(2.0 * math.pi - gaps.max()))


def _unit_coefficients(
    sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]
) -> tuple[Array, Array]:
    """A and B of each order in each unit, the other chosen orders held at the common fit.

    Both of shape (units, orders), NaN where the unit does not see the order.
    """
    index = np.asarray(orders, dtype=np.intp)
    size, n = len(chosen), index.size
    both = np.concatenate([index, np.asarray(chosen, dtype=np.intp)])
    mine = np.stack([np.arange(n), np.arange(n) + both.size], axis=1)
    theirs = np.concatenate([np.arange(n, both.size), np.arange(n, both.size) + both.size])
    coefficients, _, _ = fit_chosen_orders(sums, chosen)
    common = np.zeros((n, 2))
    for j, k in enumerate(orders):
        if k in chosen:
            place = list(chosen).index(k)
            common[j] = coefficients[[place, place + size]]
    result = np.full((sums.units, n, 2), math.nan)
    for unit in range(sums.units):
        gram = sums.gram(unit, both)
        score = sums.rhs(unit, index).reshape(2, n).T - np.einsum(
            "kib,b->ki", gram[mine[:, :, None], theirs], coefficients
        )
        blocks = gram[mine[:, :, None], mine[:, None, :]]
        trace = np.trace(blocks, axis1=1, axis2=2)
        seen = np.linalg.eigvalsh(blocks)[:, 0] > 1e-9 * trace
        step = np.linalg.solve(blocks[seen], score[seen][..., None])[..., 0]
        result[unit, seen] = common[seen] + step
    return result[..., 0], result[..., 1]


def unit_phases(sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]) -> Array:
    """Phase ``atan2(A, B)`` of each order in each unit, shape (units, orders), radians."""
    cosine, sine = _unit_coefficients(sums, chosen, orders)
    return np.asarray(np.arctan2(cosine, sine))
