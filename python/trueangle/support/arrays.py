"""Arrays as annotations name them, their distinct values, and the first of the largest."""

from __future__ import annotations

import math
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

#: Numbers of double precision, of any shape.
Array: TypeAlias = NDArray[np.float64]

_Kind = TypeVar("_Kind", bound=np.generic)


#: Share of the largest value within which others are as large: rounding is far below.
_ALIKE = 1e-7


def first_largest(values: NDArray[np.floating[Any]]) -> int:
    """Index of the first value that is as large as the largest, within 1e-7 of it.

    Mirror images are equally good; otherwise the last digit, which differs between processors,
    would decide which of them is chosen.
    """
    most = float(values.max())
    return int(np.argmax(values >= (most - _ALIKE * abs(most) if math.isfinite(most) else most)))


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
