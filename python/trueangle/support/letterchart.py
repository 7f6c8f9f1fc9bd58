"""A curve over the turn in letters, for terminals and files of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from .arrays import Array

#: Rows and columns of the picture's field.
_ROWS: Final = 11
_COLUMNS: Final = 61


def letter_chart(place: Array, errors: Mapping[str, Array], unit: str) -> list[str]:
    """Errors over a turn of 0 to 360 deg, each set by its letter; later ones lie on top.

    Examples
    --------
    >>> import numpy as np
    >>> letter_chart(np.array([0.0, 180.0]), {"o": np.array([9.0, -9.0])}, "arcsec")[1]
    '      +9 |o'
    """
    most = max(float(np.abs(error).max()) for error in errors.values()) or 1.0
    field = [[" "] * _COLUMNS for _ in range(_ROWS)]
    middle = _ROWS // 2
    field[middle] = ["-"] * _COLUMNS
    for letter, error in errors.items():
        across = np.rint(place / 360.0 * (_COLUMNS - 1)).astype(int)
        down = np.rint(middle * (1.0 - error / most)).astype(int)
        for column, row in zip(across.tolist(), down.tolist(), strict=True):
            field[row][column] = letter
    marks = {0: f"{most:+.0f}", middle: "0", _ROWS - 1: f"{-most:+.0f}"}
    lines = [f"{unit:>8}"]
    lines += [f"{marks.get(row, ''):>8} |{''.join(field[row])}".rstrip() for row in range(_ROWS)]
    ticks = "".join(f"{angle:<{_COLUMNS // 4}}" for angle in (0, 90, 180, 270)) + "360"
    return [*lines, f"{'':>9}{ticks}"]
