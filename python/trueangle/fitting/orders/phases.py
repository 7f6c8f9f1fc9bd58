"""Phases of orders, run by run, and the circular range that holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...estimation.linear import pseudo_inverse
from ...support.arrays import Array
from .harmonicsums import HarmonicSums


def circular_range_deg(phases: ArrayLike) -> Array:
    """Smallest arcs in degrees that hold all phases (radians) along the first axis.

    NaN for fewer than two.

    Examples
    --------
    >>> float(circular_range_deg(np.radians([355.0, 5.0, 1.0])).round(6))
    10.0
    """
    found = np.mod(np.asarray(phases, dtype=np.float64), 2.0 * math.pi)
    first = np.fmin.reduce(found, axis=0, keepdims=True)
    # What is not seen is put where another one is.
    around = np.sort(np.where(np.isfinite(found), found, first), axis=0)
    gaps = np.diff(around, axis=0, append=first + 2.0 * math.pi)
    seen = np.isfinite(found).sum(axis=0)
    return np.where(seen < 2, math.nan, np.degrees(2.0 * math.pi - gaps.max(axis=0)))


def _unit_coefficients(
    sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]
) -> tuple[Array, Array]:
    """A and B of each order in each unit, the other chosen orders held at the common fit.

    Both of shape (units, orders), NaN where the unit does not see the order.
    """
    index, units = np.asarray(orders, dtype=np.intp), range(sums.units)
    gram = np.sum([sums.gram(unit, chosen) for unit in units], axis=0)
    coefficients = pseudo_inverse(gram) @ np.sum([sums.rhs(u, chosen) for u in units], axis=0)
    common = np.zeros((index.size, 2))
    for place, k in enumerate(chosen):
        common[index == k] = coefficients[[place, place + len(chosen)]]
    result = np.full((sums.units, index.size, 2), math.nan)
    for unit in units:
        left = sums.rhs(unit, index) - sums.gram(unit, index, chosen) @ coefficients
        blocks, score = sums.blocks(unit, index), left.reshape(2, -1).T
        trace = np.trace(blocks, axis1=1, axis2=2)
        seen = np.linalg.eigvalsh(blocks)[:, 0] > 1e-9 * trace
        step = np.linalg.solve(blocks[seen], score[seen][..., None])[..., 0]
        result[unit, seen] = common[seen] + step
    return result[..., 0], result[..., 1]


def unit_phases(sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]) -> Array:
    """Phase ``atan2(A, B)`` of each order in each unit, shape (units, orders), radians."""
    cosine, sine = _unit_coefficients(sums, chosen, orders)
    return np.asarray(np.arctan2(cosine, sine))
