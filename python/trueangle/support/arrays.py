"""Arrays as annotations name them, their distinct values, and the first of the largest."""

from __future__ import annotations

import math
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import trueangle._core as _core


def median(values: ArrayLike, axis: int = -1) -> Any:
    """What `numpy.median` gives along one axis: NaN where a value is, or where there is none.

    Examples
    --------
    >>> float(median([3.0, 1.0, 2.0])), median([[1.0, 4.0], [3.0, 8.0]], axis=0).tolist()
    (2.0, [2.0, 6.0])
    """
    given = np.asarray(values, dtype=np.float64)
    if given.ndim == 1:
        return np.float64(_core.median(given))
    below, above, part, top = _beside(given, 0.5, axis)
    return np.where(np.isnan(top), np.nan, 0.5 * (below + above) if part else below)[()]


def quantile(values: ArrayLike, share: float, axis: int = -1) -> Any:
    """As `numpy.quantile`: linear interpolation between the two ranks next to ``share``.

    Examples
    --------
    >>> float(quantile([3.0, 1.0, 2.0, 4.0], 0.9)).__round__(12)
    3.7
    """
    below, above, part, top = _beside(values, share, axis)
    step = above - below
    # From the nearer end, as numpy does, so that what rounds is small.
    value = below + step * part if part < 0.5 else above - step * (1.0 - part)
    return np.where(np.isnan(top), np.nan, value)[()]


def _beside(values: ArrayLike, share: float, axis: int) -> tuple[Any, Any, float, Any]:
    """The values of the two ranks next to ``share``, its position between them, the last value."""
    given = np.moveaxis(np.asarray(values, dtype=np.float64), axis, -1)
    last = given.shape[-1] - 1
    if last < 0:
        nothing = np.full(given.shape[:-1], np.nan)
        return nothing, nothing, 0.0, nothing
    low = int(share * last)
    high = min(low + 1, last)
    ranked = np.partition(given, sorted({low, high, last}), axis=-1)  # NaN is last
    return ranked[..., low], ranked[..., high], share * last - low, ranked[..., last]


#: Numbers of double precision, of any shape.
Array: TypeAlias = NDArray[np.float64]

_Kind = TypeVar("_Kind", bound=np.generic)


def first_largest(values: NDArray[np.floating[Any]]) -> int:
    """Index of the first value that is as large as the largest, within 1e-7 of it.

    Mirror images are equally good; otherwise the last digit, which differs between processors,
    would decide which of them is chosen.
    """
    most = float(values.max())
    # Share of the largest value within which others are as large: rounding is far below.
    return int(np.argmax(values >= (most - 1e-7 * abs(most) if math.isfinite(most) else most)))


def distinct(values: NDArray[_Kind]) -> NDArray[_Kind]:
    """Values in ascending order, each once.

    As `numpy.unique`, which would import `numpy.ma` and take longer to start than a small command.
    Values that are that already are not copied.
    """
    if np.greater(values[1:], values[:-1]).all():
        return values
    ascending = np.sort(values)
    first = np.ones(ascending.size, dtype=np.bool_)
    first[1:] = ascending[1:] != ascending[:-1]
    return ascending[first]
