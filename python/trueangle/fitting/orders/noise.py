"""The noise of readings: pure error of repeats, scatter by units, runs and orders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...runs.aliasing import Positions
from ...support.arrays import Array
from .evidence import COLLINEAR, fit_chosen_orders
from .harmonicsums import HarmonicSums
from .zerogroups import ZeroGroupReadings

#: Sweeps of alternating means (positions, zeros); whole grids need one.
_SWEEPS: Final = 20

#: Possible pairs of unit and position for each reading up to which they are counted.
_ROOM: Final = 8


class ReadingVariance(NamedTuple):
    """Variance of one reading of weight 1.

    Attributes
    ----------
    variance : float
        Square of the unit of the error.
    degrees_of_freedom : int
    source : str
        ``"repeats"`` (readings at the same position), ``"residual"`` (of the model with
        all candidates) or ``"model"`` (residual of the orders kept so far).
    """

    variance: float
    degrees_of_freedom: int
    source: str

    @property
    def standard_deviation(self) -> float:
        """Scatter of one reading."""
        return math.sqrt(self.variance)


def pure_error(units: Sequence[ZeroGroupReadings], positions: Positions) -> ReadingVariance | None:
    """Scatter of the readings about the means of their positions and units.

    ::

        y_up = m_p + z_u + e

    with a mean ``m`` for each position and a zero ``z`` for each unit: no model of the
    error enters. None where no position was read twice.
    """
    y = np.concatenate([u.error for u in units])
    w = np.concatenate([u.weights for u in units])
    unit = np.repeat(np.arange(len(units)), [u.turns.size for u in units])
    place = positions.index
    pairs = _met(unit * len(positions) + place, len(units) * len(positions))
    # Of logs that were summed the ends of the travel are positions whose readings were not kept.
    place_weight = np.bincount(place, weights=w)
    read = np.count_nonzero(place_weight)
    place_weight = np.maximum(place_weight, 1e-300)
    dof = y.size - read - len(units) + _components(pairs, len(units), len(positions))
    if dof < 1:
        return None
    unit_weight = np.bincount(unit, weights=w)
    e = y.copy()
    for _ in range(_SWEEPS):
        e -= (np.bincount(unit, weights=w * e) / unit_weight)[unit]
        mean = np.bincount(place, weights=w * e) / place_weight
        e -= mean[place]
        if float(np.abs(mean).max()) <= 1e-9 * (float(np.abs(y).max()) or 1.0):
            break
    return ReadingVariance(float(np.dot(w, e * e)) / dof, int(dof), "repeats")


def _met(pairs: NDArray[np.int64], possible: int) -> NDArray[np.int64]:
    """The pairs that occur, in their order; counted where there is room for each possible one."""
    if possible > _ROOM * pairs.size:
        return np.unique(pairs)
    return np.flatnonzero(np.bincount(pairs, minlength=possible))


def _components(pairs: NDArray[np.int64], units: int, positions: int) -> int:
    """Groups of units that no shared position connects."""
    unit, place = pairs // positions, pairs % positions
    label = np.arange(units)
    while True:
        lowest = np.full(positions, units)
        np.minimum.at(lowest, place, label[unit])
        new = label.copy()
        np.minimum.at(new, unit, lowest[place])
        if (new == label).all():
            return len(set(label.tolist()))
        label = new


def run_scatter(sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]) -> Array:
    """Variance of one reading as each order's coefficients vary between the units.

    ::

        s_k² = (1 / (2(R-1))) Σ_r h_rkᵀ H_rk⁻¹ h_rk

    with the scores ``h = X' W (y - model)`` of each unit about their common fit: the
    noise at that order, whatever its colour, including what really changes from run to
    run. Infinite with one unit.
    """
    index = np.asarray(orders, dtype=np.intp)
    if sums.units < 2 or index.size == 0:
        return np.full(index.size, math.inf)
    coefficients, _, _ = fit_chosen_orders(sums, chosen)
    # What one order has in common with itself does not depend on those chosen.
    own = sums.blocks()[:, index]
    # At one unit's places an order may vanish, up to rounding: it says nothing there.
    most = np.trace(own, axis1=2, axis2=3).max(axis=1)
    own = own + np.maximum(1e-9 * most, 1e-150)[:, None, None, None] * np.eye(2)
    scores = [
        sums.rhs(unit, index) - sums.gram(unit, index, chosen) @ coefficients
        for unit in range(sums.units)
    ]
    score = np.reshape(scores, (sums.units, 2, -1)).transpose(0, 2, 1)
    common = np.linalg.solve(own.sum(axis=0), score.sum(axis=0)[..., None])
    a, b = (score - (own @ common)[..., 0]).transpose(2, 0, 1)
    aa, ab, bb = own[..., 0, 0], own[..., 0, 1], own[..., 1, 1]
    quadratic = (bb * a * a - 2.0 * ab * a * b + aa * b * b) / (aa * bb - ab * ab)
    return np.asarray(quadratic.sum(axis=0) / (2.0 * (sums.units - 1)))


def remaining_scatter(sums: HarmonicSums, chosen: Sequence[int]) -> Array:
    """Variance of one reading as each order that was not chosen tells it.

    ::

        v_k = T_k / 2

    with the reduction ``T`` of the sum of squares by the order beside the chosen ones: two degrees
    of freedom. nan for the chosen ones, and where an order is nearly one of them.
    """
    taken = set(chosen)
    others = np.array([i for i in range(sums.orders.size) if i not in taken], dtype=np.intp)
    found = np.full(sums.orders.size, math.nan)
    if others.size == 0:
        return found
    total, rhs, _ = sums.total()
    coefficients, inverse, _ = fit_chosen_orders(sums, chosen)
    base = sums.columns(chosen)
    cosine, sine = others, others + sums.orders.size
    to_cosine, to_sine = total[np.ix_(base, cosine)], total[np.ix_(base, sine)]
    by_cosine, by_sine = inverse @ to_cosine, inverse @ to_sine
    aa = total[cosine, cosine] - np.einsum("bk,bk->k", to_cosine, by_cosine)
    bb = total[sine, sine] - np.einsum("bk,bk->k", to_sine, by_sine)
    ab = total[cosine, sine] - np.einsum("bk,bk->k", to_cosine, by_sine)
    a = rhs[cosine] - to_cosine.T @ coefficients
    b = rhs[sine] - to_sine.T @ coefficients
    det = aa * bb - ab * ab
    seen = det > (COLLINEAR * (total[cosine, cosine] + total[sine, sine])) ** 2
    gain = (bb * a * a - 2.0 * ab * a * b + aa * b * b)[seen] / det[seen]
    found[others[seen]] = 0.5 * np.maximum(gain, 0.0)
    return found
