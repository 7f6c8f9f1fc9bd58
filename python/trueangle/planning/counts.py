"""Whole readings of a design: its weights rounded, single readings exchanged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array, first_largest
from .doptimal import OrthonormalColumns

#: Passes of exchanges of single readings.
_PASSES = 20

#: Relative gain of the determinant below which readings are not exchanged.
_GAIN = 1e-9


def exchanged(columns: OrthonormalColumns, places: Array) -> Array:
    """Places of single readings, each exchanged for a better one of the grid while one is.

    Fedorov's exchange: taking reading i out and x in multiplies the determinant by
    ``(1 + d_xx)(1 - d_ii) + d_ix²``.
    """
    grid = columns.at(columns.grid)
    places = places.copy()
    for _ in range(_PASSES):
        before = columns.log_det(places, np.ones(places.size))
        for i in range(places.size):
            rows = columns.at(places)
            inverse = np.linalg.inv(rows.T @ rows)
            mixed = grid @ (inverse @ rows[i])
            own = float(rows[i] @ inverse @ rows[i])
            gains = (1.0 + np.einsum("ij,ij->i", grid @ inverse, grid)) * (1.0 - own) + mixed**2
            k = first_largest(gains)
            if gains[k] > 1.0 + _GAIN:
                places[i] = columns.grid[k]
        if columns.log_det(places, np.ones(places.size)) < before + 1e-4:
            break
    return np.sort(places)


def rounded(weights: Array, readings: int) -> NDArray[np.int64]:
    """Whole numbers of readings that lose the least (Pukelsheim and Rieder 1992).

    Examples
    --------
    >>> rounded(np.array([0.5, 0.3, 0.2]), 7).tolist()
    [3, 2, 2]
    """
    counts = np.ceil((readings - 0.5 * weights.size) * weights).astype(np.int64)
    while counts.sum() < readings:
        counts[np.argmin(counts / weights)] += 1
    while counts.sum() > readings:
        counts[np.argmax((counts - 1) / weights)] -= 1
    return np.asarray(counts)
