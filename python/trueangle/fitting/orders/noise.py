"""The noise of readings: pure error of repeats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...runs.aliasing import Positions
from .zerogroups import ZeroGroupReadings

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
        all candidates) or ``"evidence"`` (that of most evidence).
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
    # Sweeps of alternating means (positions, zeros); whole grids need one.
    for _ in range(20):
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
