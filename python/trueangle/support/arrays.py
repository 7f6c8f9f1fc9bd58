"""Arrays as annotations name them, and their distinct values."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

#: Numbers of double precision, of any shape.
Array: TypeAlias = NDArray[np.float64]

_Kind = TypeVar("_Kind", bound=np.generic)


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
