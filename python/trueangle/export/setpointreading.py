"""Forward and reverse tables of set points as a model: a pattern and a reversal error."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.model import HarmonicModel
from .reading import ReadTable, failed, function_model
from .table import TURN
from .target import Target

__all__ = ["travel_model"]

Array = NDArray[np.float64]


def travel_model(table: Array, path: str, target: Target, last_digit: float) -> HarmonicModel:
    """Model of ``nominal, forward, reverse`` in degrees, the error at the true angle.

    The mean of the two columns is the pattern; the mean of half of their difference is a
    backlash term. What is left of the difference changes with the place and is said.

    Raises
    ------
    FileError
        Less than a turn, or a turn that does not close.
    """
    from ..terms import Backlash

    nominal, forward, reverse = table.T
    travel = nominal[-1] - nominal[0]
    spacing = float(np.median(np.diff(nominal)))
    if travel < 360.0 - 1.01 * spacing:
        raise failed(
            path,
            f"covers {travel:.6g} deg: a model of the turn needs 360; what it does there is in "
            "its own lines",
        )
    half = (forward - reverse) / 2.0
    entries = max(4, round(360.0 / spacing))
    pattern = (forward + reverse) / 2.0

    def function(x: Array) -> Array:
        place = nominal[0] + (x * 360.0 - nominal[0]) % 360.0
        if travel < 360.0:  # the last line is not given again
            return np.asarray(
                np.interp(
                    place,
                    np.append(nominal, nominal[0] + 360.0),
                    np.append(pattern, pattern[0]),
                )
                / 360.0
            )
        return np.asarray(np.interp(place, nominal, pattern) / 360.0)

    play = float(np.mean(half))
    varies = float(np.sqrt(np.mean((half - play) ** 2)))
    terms = [Backlash(play)] if abs(play) > last_digit / math.sqrt(12.0 * len(half)) else []
    note = f"read from a table of {target.name}; the uncertainty is that of its numbers"
    if varies > last_digit:
        note += (
            f"; forward and reverse differ by a pattern of {varies * 3600.0:.4g} arcsec rms "
            "beside their mean, which is not in the model"
        )
    return function_model(
        [ReadTable("output", 1.0, function, entries, last_digit / 360.0, forward=True)],
        path,
        target,
        lambda places: function(places / TURN),
        terms=terms,
        note=note,
    )
