"""Sums over the powers of points on the unit circle: what spectra of positions are made of."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

#: Powers between two fresh evaluations: keeps rounding near 1e-15 * 64.
_RESEED: Final = 64

#: Points whose powers are kept at once: they stay in the cache.
_BLOCK: Final = 512


def power_sums(
    turns: NDArray[np.float64], columns: NDArray[np.float64], count: int
) -> NDArray[np.complex128]:
    """Sums of ``columns`` under the powers of points on the unit circle.

    ::

        S_mj = Σ_i c_ij e^(2π i m t_i),    m = 0, ..., count - 1

    ``turns`` (n,) are the angles of the points in turns, any number of them, ``columns`` is (n, k)
    and the result (count, k): to 1e-14 of the sums of ``abs(columns)``; O(n count k), by products
    of matrices.

    Examples
    --------
    >>> import numpy as np
    >>> sums = power_sums(np.arange(4) / 4.0, np.ones((4, 1)), 5)[:, 0]
    >>> (np.round(sums.real, 12) + 0.0).tolist()
    [4.0, 0.0, 0.0, 0.0, 4.0]
    """
    found = np.zeros((count, columns.shape[1]), dtype=np.complex128)
    for start in range(0, turns.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        within = turns[part] - np.floor(turns[part])
        step = np.exp(2j * math.pi * within)
        right = columns[part] + 0j
        for first in range(0, count, _RESEED):
            powers = np.empty((min(_RESEED, count - first), within.size), dtype=np.complex128)
            # The product m * t loses what lies before the point: take it off first.
            phase = first * within
            powers[0] = np.exp(2j * math.pi * (phase - np.round(phase)))
            filled, stride = 1, step
            while filled < len(powers):
                more = powers[filled : 2 * filled]
                np.multiply(powers[: len(more)], stride, out=more)
                filled, stride = 2 * filled, stride * stride
            found[first : first + len(powers)] += powers @ right
    return found
