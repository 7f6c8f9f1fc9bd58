"""Outliers of a run, found without any model of its error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

if TYPE_CHECKING:
    from .run import CalibrationRun

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


def outlying(run: CalibrationRun) -> tuple[NDArray[np.intp], Array]:
    """Rows of the outliers of a run, one by one or several side by side, and how far each is off.

    That is more than 8 robust standard deviations from the readings beside it, both in the order of
    the places and in that of the rows (`src/outliers.rs`). None of fewer than 12 readings is one.
    """
    used = slice(None) if run.weights is None else np.flatnonzero(run.weights > 0.0)
    error, angle, read = (
        np.ascontiguousarray(x[used]) for x in (run.centred_error, run.reference, run.indicated)
    )
    found = _core.outliers(
        error, angle, read, run.period, wild=WILD, share=WILD_SHARE, fewest=FEWEST, sample=SAMPLE
    )
    rows, distance = np.array(found, dtype=float).reshape(-1, 2).T
    return np.arange(len(run))[used][rows.astype(np.intp)], distance
