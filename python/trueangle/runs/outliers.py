"""Isolated outliers of a run, found without any model of its error."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array, median, quantile

#: Median absolute deviation to standard deviation, for the normal distribution.
MAD_TO_SIGMA: Final = 1.4826

#: Readings further off than this many robust standard deviations are outliers. Of 1e12 normal
#: readings not one is.
WILD: Final = 8.0

#: With more than this share beyond `WILD` the readings are no outliers: the model lacks an
#: effect, and least squares on all of them is the honest answer.
WILD_SHARE: Final = 0.2

#: The scale is taken from at most about this many readings.
SAMPLE: Final = 4096

#: Readings whose median a spike is compared with.
_NEIGHBOURS: Final = 7


def robust_scale(residuals: Array) -> float:
    """Standard deviation by the median absolute deviation: half the readings may be outliers."""
    return MAD_TO_SIGMA * _core.median_magnitude(np.ascontiguousarray(residuals), SAMPLE)


def spikes(error: Array, angle: Array, period: float) -> tuple[NDArray[np.bool_], Array]:
    """Which readings are isolated outliers, and how far each is off its neighbours.

    A reading is a spike where it lies more than 8 robust standard deviations off the median of
    its neighbours in angle, and off the line between the next two; an error that changes as much
    from neighbour to neighbour widens the limit itself, and so does noise on a slope. None of
    fewer than 28 readings is one.
    """
    none = np.zeros(error.size, dtype=np.bool_)
    if error.size < 4 * _NEIGHBOURS:
        return none, np.zeros_like(error)
    order = np.argsort(np.mod(angle, period), kind="stable")
    around = _windows(error[order])
    deviation = np.empty_like(error)
    deviation[order] = error[order] - median(around, axis=1)
    distance = np.abs(deviation)
    # On a slope most readings are the median of their neighbours: what they scatter by is what
    # they are off the line between the next two, 3/2 of the variance.
    middle = _NEIGHBOURS // 2
    between = around[:, middle] - 0.5 * (around[:, middle - 1] + around[:, middle + 1])
    # Readings in counts: most deviations may be exactly 0, the others one count.
    scales = robust_scale(deviation), robust_scale(between) / math.sqrt(1.5)
    limit = WILD * max(*scales, float(quantile(distance, 0.8)))
    far = distance > limit
    if far.any():
        # Across a gap a steep error is far off its neighbours, but not off the line between them.
        place = np.mod(angle, period)[order]
        before, after = np.roll(error[order], 1), np.roll(error[order], -1)
        back = np.mod(place - np.roll(place, 1), period)
        gap = back + np.mod(np.roll(place, -1) - place, period)
        share = np.divide(back, gap, out=np.full_like(gap, 0.5), where=gap > 0.0)
        line = before + share * (after - before)
        distance[order] = np.minimum(distance[order], np.abs(error[order] - line))
        far &= distance > limit
        # On a slope an outlier moves the median of its neighbours, so it is replaced for them.
        wilder = _windows(np.where(far, distance, 0.0)[order]) > 2.0 * distance[order, None]
        around = np.where(wilder, _windows((error - deviation)[order]), around)
        far[order] &= np.abs(error[order] - median(around, axis=1)) > limit
    return (none if far.mean() > WILD_SHARE else far), distance


def _windows(values: Array) -> Array:
    """Each of the values of a turn with the three before it and the three after it."""
    around = np.pad(values, _NEIGHBOURS // 2, mode="wrap")
    return np.lib.stride_tricks.sliding_window_view(around, _NEIGHBOURS)
