"""The greatest slope of an error: from 1 on it cannot be corrected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

import trueangle._core as _core

__all__ = ["greatest_slope"]

#: Samples per period of the highest order: the greatest of them is at most 0.5 % low.
_SAMPLES: Final = 32


def greatest_slope(
    orders: Sequence[float], cosine: ArrayLike, sine: ArrayLike, period: float
) -> float:
    """``max |d error / d angle|`` of a series, by sampling it, not by adding amplitudes.

    Whole orders are sampled over a turn and raised by Bernstein's ``1 / cos(pi / 32)``,
    which a trigonometric polynomial cannot exceed between the samples. An order that is not
    whole comes to every phase against them sooner or later: its amplitude is added.

    Examples
    --------
    >>> greatest_slope([1, 3], [0.0, 0.0], [9 / 8 * 0.5, 0.5 / 8], 2 * math.pi) < 0.76
    True
    """
    m, a, b = (np.asarray(v, dtype=np.float64) for v in (orders, cosine, sine))
    whole = m == np.round(m)
    rate = 2.0 * math.pi / period
    aside = rate * float(np.hypot(a[~whole], b[~whole]) @ m[~whole])
    bound = rate * float(np.hypot(a[whole], b[whole]) @ m[whole])
    if not whole.any() or aside + bound < _LOW:
        return aside + bound
    lines = sorted(zip(m[whole].astype(int).tolist(), a[whole], b[whole], strict=True))
    series = _core.Series(
        period,
        0.0,
        [1.0],
        [[k for k, _, _ in lines]],
        [[float(v) for _, v, _ in lines]],
        [[float(v) for _, _, v in lines]],
        "indicated",
    )
    samples = _SAMPLES * lines[-1][0]
    slopes = np.asarray(series.slope(np.arange(samples) * (period / samples)))
    return aside + float(np.abs(slopes).max()) / math.cos(math.pi / _SAMPLES)


#: Below this the sum of amplitudes says enough.
_LOW: Final = 0.5
