"""What controls that move the set point have in common: a table of the true angle over travel.

The drive makes its encoder read the commanded angle. To be at theta it must be commanded to
``theta + error(theta)``: the values are the error at the true angle, without an inversion, one
column for each direction of travel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.arrays import Array
from .knots import linear_knots
from .pattern import TurnPattern
from .proof import Correction, lost_orders
from .reading import ReadTable, function_model
from .table import TURN
from .target import Option, TablePart, Target

Function = Callable[[Array], Array]

#: Options of such targets: the ends of the travel, and at how many positions a table is checked.
ENDS = {
    "start": Option(
        float, None, "of the travel, degrees (default: what the model was fitted on, else 0)"
    ),
    "stop": Option(float, None, "of the travel, degrees (default: likewise, else 360)"),
}
POSITIONS = Option(int, 20, "2^bits positions are evaluated, and more where entries are many")

#: Of a degree, as nominal positions are written.
NOMINAL_DECIMALS = 7

#: Entries to a turn.
_MOST = 36_000

#: Points per turn between which a pattern that follows direction is taken: 1e-4 arcsec off where
#: order 8 is as steep as may be.
_GRID = 1 << 18

#: Points to an entry on which the way back over a partial travel is laid, and entries at most: it
#: is one cubic, however close the entries are.
_WAY_BACK, _MOST_ENTRIES = 8, 1 << 14


@dataclass(frozen=True)
class SetpointTravel:
    """Nominal positions over the travel of an axis, and the errors there, in turns.

    Attributes
    ----------
    start, stop : float
        Degrees.
    entries : int
        To a turn.
    nominal : ndarray
        Degrees.
    forward, reverse : ndarray
        Least-squares knots of the error.
    function : callable
        What ``forward`` is of, at angles in turns.
    """

    start: float
    stop: float
    entries: int
    nominal: Array
    forward: Array
    reverse: Array
    function: Function

    @classmethod
    def of(
        cls,
        pattern: TurnPattern,
        target: str,
        options: Mapping[str, Any],
        most: int,
        function: Function | None = None,
        divided: int = 0,
        usual: int = 360,
    ) -> SetpointTravel:
        """Knots over the travel that is requested, else over what the model was fitted on.

        They are of the error at the true angle, for each direction, or of a ``function``. Where
        entries to a turn must be divisors of a number, that is ``divided``. Without a number that
        is requested they are the ``usual`` one, or the best that orders and travel leave.

        Raises
        ------
        ArgumentError
            More entries than the target takes, too few for the orders, no travel.
        """
        ends = zip(("start", "stop"), _calibrated_travel(pattern), strict=True)
        start, stop = (end if options[key] is None else options[key] for key, end in ends)
        if not stop > start:
            raise ArgumentError(f"stop must be above `start=`, got {start:g} to {stop:g} deg")
        pattern.check_one_turn(target)
        largest = min(int((most - 1) * 360.0 / (stop - start) + 1e-9), _MOST)
        allowed = [
            n for n in range(max(pattern.least_entries(), 4), largest + 1) if not divided % n
        ]
        entries = options["entries"]
        if entries is None:  # the largest that is allowed up to the usual number, else at all
            entries = max((n for n in allowed if n <= usual), default=max(allowed, default=usual))
        if not 4 <= entries <= _MOST:
            raise ArgumentError(f"entries must be from 4 to {_MOST} a turn, got {entries}")
        pattern.check_orders(entries, target, allowed)
        count = math.ceil((stop - start) * entries / 360.0 - 1e-9) + 1
        if count > most:
            fits = f"`entries={max(allowed)}` or less" if allowed else '`target="c"`'
            raise ArgumentError(
                f"{target} takes {most} entries, and {entries} a turn over {stop - start:g} deg "
                f"are {count}: use {fits}, or a shorter travel"
            )
        first = start / 360.0
        forward, reverse = (
            linear_knots(_moved(function or _error(pattern, direction), first), entries)[
                np.arange(count) % entries
            ]
            for direction in (1, -1)
        )
        nominal = np.round(start + np.arange(count) * (360.0 / entries), NOMINAL_DECIMALS)
        shown = function or _error(pattern, 1)
        return cls(start, stop, entries, nominal, forward, reverse, shown)

    def part(self, pattern: TurnPattern, forward: Array, reverse: Array) -> TablePart:
        """Proof of printed values (turns of error) at set points over the travel.

        The drive stops where its encoder reads the set point plus the value. The error is the
        distance of the joint from the set point there.
        """

        def standing(values: Array, direction: int) -> Correction:
            joint = _joint(pattern, direction)

            def at(places: NDArray[np.int64]) -> Array:
                # The inputs are spread over the travel.
                x = self.start + places / 2.0**32 * (self.stop - self.start)
                told = np.interp(x, self.nominal, values)
                return joint(x / 360.0 + told) - x / 360.0

            return at

        ways = ((forward, 1), (reverse, -1)) if pattern.has_direction else ((forward, 1),)
        return TablePart(
            tuple(standing(values, d) for values, d in ways), np.zeros_like, continuous=True
        )

    def at_readings(self, pattern: TurnPattern, values: Array) -> TablePart:
        """Proof of printed values (turns to subtract) that are looked up at the reading."""

        def reading(x: Array) -> Array:
            # The inputs are spread over the travel.
            return (self.start + x * (self.stop - self.start)) / 360.0

        def looked_up(places: NDArray[np.int64]) -> Array:
            return np.asarray(np.interp(reading(places / 2.0**32) * 360.0, self.nominal, values))

        def exact(x: Array) -> Array:
            return pattern.correction(reading(x))

        return TablePart((looked_up,), exact, continuous=True)

    def lost(self, pattern: TurnPattern) -> list[dict[str, float]]:
        """What one turn of least-squares lines loses of each order."""
        error = self.function
        knots = linear_knots(error, self.entries)
        closed = np.append(knots, knots[0])
        places = np.arange(self.entries + 1) / self.entries

        def table(angles: NDArray[np.int64]) -> Array:
            return np.asarray(np.interp(angles / 2.0**32, places, closed))

        found = lost_orders(table, error, pattern.lines)
        return [{"order": float(k), "arcsec": lost} for k, lost in found.items()]


def _moved(error: Function, first: float) -> Function:
    return lambda x: error(x + first)


def _calibrated_travel(pattern: TurnPattern) -> tuple[float, float]:
    """Degrees over which the model holds: its span, or one turn."""
    span = pattern.source.partial_span
    if span is None:
        return 0.0, 360.0
    # Degrees with the digits that one would write: the list of a control may not have more.
    start, stop = (round(end / pattern.period * 360.0, 4) for end in span)
    return start, stop


def _error(pattern: TurnPattern, direction: int) -> Function:
    """Error at true angles in turns, without the constant, travelling one way."""
    if not pattern.has_direction:
        return lambda x: np.asarray(pattern.reading(x) - x - pattern.zero)
    places, values = _directed(pattern, direction)
    return lambda x: np.asarray(np.interp(x % 1.0, places, values - places))


def _joint(pattern: TurnPattern, direction: int) -> Function:
    """True angles in turns where the encoder has been brought to readings, the zero apart."""
    if not pattern.has_direction:
        return lambda r: r - pattern.correction(r + pattern.zero)
    places, values = _directed(pattern, direction)

    def joint(reading: Array) -> Array:
        turn = np.floor(reading - values[0])
        return np.asarray(np.interp(reading - turn, values, places) + turn)

    return joint


def _directed(pattern: TurnPattern, direction: int) -> tuple[Array, Array]:
    """Places over a turn and readings there, travelling one way."""
    if pattern.model.argument == "indicated":
        raise ArgumentError(
            "a model with terms of direction and the indicated argument has no error at the true "
            'angle in one pass: fit it with `argument="reference"`'
        )
    grid = np.arange(_GRID) / _GRID
    values = grid + pattern.directed(grid, direction)
    return np.append(grid, 1.0), np.append(values, values[0] + 1.0)


def axis_steepness(travel: SetpointTravel) -> tuple[float, float]:
    """Largest slope (deg per deg) and its change per degree: what an axis must follow."""
    h = 360.0 / travel.entries
    slopes = [np.diff(values) * 360.0 / h for values in (travel.forward, travel.reverse)]
    slope = max(float(np.max(np.abs(s))) for s in slopes)
    bend = max(float(np.max(np.abs(np.diff(s)), initial=0.0)) / h for s in slopes)
    return slope, bend


def travel_model(
    table: Array, path: str, target: Target, last_digit: float, forward: bool = True
) -> HarmonicModel:
    """Model of ``nominal, forward, reverse`` in degrees: errors at the true angle.

    The mean of the two columns is the pattern; the mean of half of their difference is a
    backlash term. The remainder of the difference changes with the angle and is reported. A table
    of less than a turn is closed by a cubic from its end to its start; the model states that it
    holds over the table's travel only.

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
        A travel of fewer than four entries.
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
        raise FileError(path, f"holds {len(nominal)} points over {travel:.6g} deg: four are needed")
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
            "about their mean, which is not in the model"
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
    # Slopes of the lines next to the ends of the travel.
    first = (pattern[-1] - pattern[-2]) / (nominal[-1] - nominal[-2]) * width
    last = (pattern[1] - pattern[0]) / (nominal[1] - nominal[0]) * width
    way = (
        pattern[-1] * (1.0 + 2.0 * t) * (1.0 - t) ** 2
        + first * t * (1.0 - t) ** 2
        + pattern[0] * t**2 * (3.0 - 2.0 * t)
        + last * t**2 * (t - 1.0)
    )
    return np.append(nominal, start + t * width), np.append(pattern, way)
