"""Tables over a travel as a model: a pattern and a reversal error."""

from __future__ import annotations

import math

import numpy as np

from ..model.model import HarmonicModel
from ..support.arrays import Array
from .reading import ReadTable, function_model, table_error
from .table import TURN
from .target import Target

#: Points to an entry on which the way back over a partial travel is laid, and entries at most: it
#: is one cubic, however close the entries are.
_WAY_BACK, _MOST_ENTRIES = 8, 1 << 14


def travel_model(
    table: Array, path: str, target: Target, last_digit: float, forward: bool = True
) -> HarmonicModel:
    """Model of ``nominal, forward, reverse`` in degrees: errors at the true angle.

    The mean of the two columns is the pattern; the mean of half of their difference is a
    backlash term. What is left of the difference changes with the place and is said. A table of
    less than a turn is closed by a cubic from its end to its start; the model holds over the
    table's travel, and says so.

    Parameters
    ----------
    table : ndarray, shape (n, 3)
    path : str
    target : Target
    last_digit : float
        Degrees.
    forward : bool
        The values are the error at the true angle, else the correction of a reading.

    Raises
    ------
    FileError
        A travel of no more than three entries.
    """
    from ..model.terms import Backlash

    nominal, ahead, back = table.T
    travel = float(nominal[-1] - nominal[0])
    spacing = float(np.median(np.diff(nominal)))
    partial = travel < 360.0 - 1.01 * spacing
    half = (ahead - back) / 2.0
    entries = max(4, round(360.0 / spacing))
    pattern = (ahead + back) / 2.0
    places, values = nominal, pattern
    if len(nominal) < 4:
        raise table_error(
            path, f"holds {len(nominal)} points over {travel:.6g} deg: four are needed"
        )
    if partial:
        places, values = _closed(nominal, pattern, spacing)
    elif travel < 360.0:  # the last line is not given again
        places = np.append(nominal, nominal[0] + 360.0)
        values = np.append(pattern, pattern[0])

    def function(x: Array) -> Array:
        place = nominal[0] + (x * 360.0 - nominal[0]) % 360.0
        return np.asarray(np.interp(place, places, values) / 360.0)

    play = float(np.mean(half))
    varies = float(np.sqrt(np.mean((half - play) ** 2)))
    terms = [Backlash(play)] if abs(play) > last_digit / math.sqrt(12.0 * len(half)) else []
    note = f"read from a table of {target.name}; the uncertainty is that of its numbers"
    if partial:
        note += f"; it covers {nominal[0]:.6g} to {nominal[-1]:.6g} deg, and holds there"
    if varies > last_digit:
        note += (
            f"; forward and reverse differ by a pattern of {varies * 3600.0:.4g} arcsec rms "
            "beside their mean, which is not in the model"
        )
    return function_model(
        [ReadTable("output", 1.0, function, entries, last_digit / 360.0, forward=forward)],
        path,
        target,
        lambda places: function(places / TURN),
        terms=terms,
        note=note,
        travel=(float(nominal[0]), float(nominal[-1])) if partial else None,
    )


def _closed(nominal: Array, pattern: Array, spacing: float) -> tuple[Array, Array]:
    """A table and the way back from its end to its start a turn later: Hermite's cubic."""
    start, stop = nominal[-1], nominal[0] + 360.0
    width = stop - start
    entries = min(max(4, round(width / spacing)), _MOST_ENTRIES)
    t = np.linspace(0.0, 1.0, _WAY_BACK * entries + 1)[1:]
    # Slopes over the travel beside the ends, as lines have them.
    first = (pattern[-1] - pattern[-2]) / (nominal[-1] - nominal[-2]) * width
    last = (pattern[1] - pattern[0]) / (nominal[1] - nominal[0]) * width
    way = (
        pattern[-1] * (1.0 + 2.0 * t) * (1.0 - t) ** 2
        + first * t * (1.0 - t) ** 2
        + pattern[0] * t**2 * (3.0 - 2.0 * t)
        + last * t**2 * (t - 1.0)
    )
    return np.append(nominal, start + t * width), np.append(pattern, way)
