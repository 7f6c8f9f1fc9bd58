"""Control charts of a unit's calibrations: a cumulative sum for each coefficient."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..support.arrays import Array
from .calibration import Calibration

#: Half of the shift that is looked for, in standard deviations of a calibration.
ALLOWANCE: Final = 0.5

#: Dates until a unit's charts together alarm where nothing moves, on average (h = 5 for one chart).
LENGTH: Final = 465.44


def charted(calibrations: Sequence[tuple[Calibration, float]], changes: Array) -> Array:
    """The larger sum of every order on every further date, shape (dates - 1, K).

    ::

        z_t = (b_t - b̄_{t-1}) / √(V_t + V̄_{t-1} / t),
        C±_t = max(0, C±_{t-1} ± z_t - 1/2)

    against the mean of the t dates before, so that the z are independent where nothing moves;
    V is the noise of a date and half of the variance of an ordinary change between two.

    Parameters
    ----------
    calibrations : sequence of (Calibration, float)
        In the order of their dates, with the variance of a reading.
    changes : ndarray, shape (K,)
        Variance of an ordinary change of each order's cosine and sine.
    """
    values = np.array([one.coefficients for one, _ in calibrations])
    own = np.array(
        [noise * np.diagonal(one.blocks(), axis1=1, axis2=2).ravel() for one, noise in calibrations]
    )
    spread = own + 0.5 * np.repeat(changes, 2) + 1e-300
    sums = np.zeros((2, values.shape[1]))
    found = []
    for t in range(1, len(values)):
        before = spread[:t].mean(axis=0) / t
        z = (values[t] - values[:t].mean(axis=0)) / np.sqrt(spread[t] + before)
        sums = np.maximum(0.0, sums + np.array([z, -z]) - ALLOWANCE)
        found.append(sums.max(axis=0).reshape(-1, 2).max(axis=1))
    return np.array(found)
