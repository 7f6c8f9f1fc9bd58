"""Phases of orders, run by run, and the circular range that holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...estimation.linear import pseudo_inverse
from ...support.arrays import Array
from .chosen import products


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


def unit_phases(units: Sequence[Array], chosen: Sequence[int]) -> Array:
    """Phase ``atan2(A, B)`` of each order in each unit, shape (units, orders), radians.

    The other chosen orders are held at the common fit; NaN where a unit does not see the order.
    ``units`` are as `zerogroups.unit_columns` gives them.
    """
    every = [products(unit, chosen) for unit in units]
    pairs = np.arange(units[0].shape[1] - 1).reshape(-1, 2)
    mine = pairs[list(chosen)].ravel()
    total = np.sum([own.mine for own in every], axis=0)
    fitted = pseudo_inverse(total[:, mine]) @ total[:, -1]
    common = np.zeros(pairs.size)
    common[mine] = fitted
    found = np.full((len(units), *pairs.shape), math.nan)
    for unit, own in zip(found, every, strict=True):
        scores = (own.scores - fitted @ own.mine[:, :-1])[pairs]
        seen = np.linalg.eigvalsh(own.blocks)[:, 0] > 1e-9 * np.trace(own.blocks, 0, 1, 2)
        step = np.linalg.solve(own.blocks[seen], scores[seen][..., None])[..., 0]
        unit[seen] = common[pairs][seen] + step
    return np.asarray(np.arctan2(found[..., 0], found[..., 1]))
