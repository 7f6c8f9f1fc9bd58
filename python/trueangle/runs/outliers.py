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

#: Readings of a turn from which on they show the one that is wrong.
FEWEST: Final = 12


def robust_scale(residuals: Array) -> float:
    """Standard deviation by the median absolute deviation: half the readings may be outliers."""
    return MAD_TO_SIGMA * _core.median_magnitude(np.ascontiguousarray(residuals), SAMPLE)


def spikes(error: Array, angle: Array, period: float) -> tuple[NDArray[np.bool_], Array]:
    """Which readings are isolated outliers, and how far each is off its neighbours.

    A reading is a spike where it lies more than 8 robust standard deviations off the line between
    the next two in angle, and off those through the two on either side. What an error of the place
    bends between two readings grows with the gaps to both, so wide gaps count the less. None of
    fewer than 12 readings is one.
    """
    far, distance = np.zeros(error.size, dtype=np.bool_), np.zeros_like(error)
    order = np.argsort(np.mod(angle, period), kind="stable")
    while order.size >= FEWEST:
        place, read = np.mod(angle, period)[order], error[order]
        back = np.mod(place - np.roll(place, 1), period)
        ahead, rise = np.roll(back, -1), read - np.roll(read, 1)
        slope = np.divide(rise, back, out=np.zeros_like(back), where=back > 0.0)
        share = np.divide(back, back + ahead, out=np.full_like(back, 0.5), where=back + ahead > 0.0)
        away = (1.0 - share) * rise - share * np.roll(rise, -1)
        bent = back * ahead
        bent /= median(bent[bent > 0.0]) if bent.any() else 1.0
        scaled = away / np.maximum(bent, 1.0)
        # From a line between two normal readings a third is off by 3/2 of the variance. Of readings
        # in counts most may be exactly on it, the others one count off: within one standard
        # deviation are 68.27 % of normal readings.
        usual = max(robust_scale(scaled), float(quantile(np.abs(scaled), 0.6827)))
        # At a step the line from either side alone goes on.
        after = np.roll(rise, -1) - np.roll(slope, -2) * ahead
        off = np.min(np.abs([away, rise - np.roll(slope, 1) * back, after]), axis=0)
        # The farthest of those side by side first: its neighbours are off the line by it.
        peak = (off >= np.roll(off, 1)) & (off >= np.roll(off, -1))
        peak &= np.minimum(off, np.abs(scaled)) > WILD * usual / math.sqrt(1.5)
        if not peak.any():
            break
        far[order[peak]], distance[order[peak]] = True, np.abs(away[peak])
        if far.mean() > WILD_SHARE:
            return np.zeros_like(far), distance
        order = order[~peak]
    return far, distance
