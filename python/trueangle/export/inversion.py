"""Where a rising function takes given values, by brackets: no slope makes it diverge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import NotInvertibleError
from ..support.arrays import Array

#: Steps of regula falsi. A bracket that holds a line needs one; of a curve each step leaves
#: the share of it by which the bracket is bent, a hundredth and less.
_STEPS = 8


def inverse_rising(rising: Callable[[Array], Array], wanted: Array, points: int) -> Array:
    """``x`` with ``rising(x) = wanted``, for a function that gains one turn per turn.

    Parameters
    ----------
    rising : callable
        Of angles in turns, ``rising(x + 1) = rising(x) + 1``.
    wanted : ndarray
        Its values, over any number of turns.
    points : int
        Brackets to a turn; corners of the function should stand between two of them.

    Raises
    ------
    NotInvertibleError
        It falls somewhere: one value would stand for several angles.

    Examples
    --------
    >>> def steep(x):
    ...     return x + 0.99 / (2 * np.pi) * np.sin(2 * np.pi * x)
    >>> x = inverse_rising(steep, np.array([-0.6, 0.0, 2.4]), 64)
    >>> bool(np.max(np.abs(steep(x) - [-0.6, 0.0, 2.4])) < 1e-12)
    True
    """
    at = np.arange(points + 1) / points
    values = rising(at)
    rise = np.diff(values)
    if np.min(rise) <= 0.0:
        k = int(np.argmin(rise))
        raise NotInvertibleError(
            f"it is not monotone between {at[k] * 360.0:.4g} and {at[k + 1] * 360.0:.4g} deg: one "
            "corrected angle would stand for several readings",
            float(1.0 - rise[k] * points),
        )
    turn = np.floor(wanted - values[0])
    wanted = wanted - turn
    i = np.clip(np.searchsorted(values, wanted, side="right") - 1, 0, points - 1)
    low, high = at[i], at[i + 1]
    below, above = values[i] - wanted, values[i + 1] - wanted
    found = low
    for _ in range(_STEPS):
        found = low - below * ((high - low) / (above - below))
        left = rising(found) - wanted
        if not np.any(np.abs(left) > _EXACT):
            break
        short = left < 0.0
        low, below = np.where(short, found, low), np.where(short, left, below)
        high, above = np.where(short, high, found), np.where(short, above, left)
        flat = above - below <= 0.0  # a bracket of one step of the function's own rounding
        above = np.where(flat, below + 1.0, above)
    return np.asarray(found + turn)


#: Turns: the rounding of a double.
_EXACT = 1e-15
