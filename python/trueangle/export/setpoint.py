"""What controls that move the set point have in common: a table of the true angle over travel.

The drive makes its encoder read what it is told. To stand at theta it must be told
``theta + error(theta)``: the values are the error at the true angle, without an inversion, one
column for each direction of travel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from .knots import linear_knots
from .pattern import Pattern
from .proof import Correction, lost_orders
from .target import Part

__all__ = ["Travel", "steepness"]

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

#: Points per turn at which a pattern that follows direction is taken between.
_GRID = 1 << 16


@dataclass(frozen=True)
class Travel:
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
    """

    start: float
    stop: float
    entries: int
    nominal: Array
    forward: Array
    reverse: Array

    @classmethod
    def of(
        cls, pattern: Pattern, target: str, start: float, stop: float, entries: int, most: int
    ) -> Travel:
        """Knots over the travel.

        Raises
        ------
        ArgumentError
            More entries than the target takes, too few for the orders, no travel.
        """
        if not stop > start:
            raise ArgumentError(f"--stop must be above --start, got {start:g} to {stop:g} deg")
        pattern.check_one_turn(target)
        if not 4 <= entries <= 36_000:
            raise ArgumentError(f"--entries must be from 4 to 36000 a turn, got {entries}")
        top = int(max(pattern.lines, default=0.0))
        pattern.check_orders(entries, target, f"use --entries {2 * top + 1} or more")
        count = math.ceil((stop - start) * entries / 360.0 - 1e-9) + 1
        if count > most:
            fits = int((most - 1) * 360.0 / (stop - start))
            raise ArgumentError(
                f"{target} takes {most} entries, and {entries} a turn over {stop - start:g} deg "
                f"are {count}: use --entries {fits} or less, or a shorter travel"
            )
        first = start / 360.0
        forward, reverse = (
            linear_knots(_moved(_error(pattern, direction), first), entries)[
                np.arange(count) % entries
            ]
            for direction in (1, -1)
        )
        nominal = np.asarray(start + np.arange(count) * (360.0 / entries), dtype=np.float64)
        return cls(start, stop, entries, nominal, forward, reverse)

    def part(self, pattern: Pattern, forward: Array, reverse: Array) -> Part:
        """Proof of printed values (turns of error) at set points over the travel."""

        def difference(values: Array, direction: int) -> Correction:
            error = _error(pattern, direction)

            def at(angles: NDArray[np.uint32]) -> Array:
                # The inputs are spread over the travel.
                x = self.start + angles / 2.0**32 * (self.stop - self.start)
                found = np.interp(x, self.nominal, values)
                return np.asarray(found - error(x / 360.0))

            return at

        both = tuple(difference(values, d) for values, d in ((forward, 1), (reverse, -1)))
        spread = (self.stop - self.start) / 360.0
        return Part(both, np.zeros_like, 2.0 * pattern.slope * spread)

    def lost(self, pattern: Pattern) -> list[dict[str, float]]:
        """What one turn of least-squares lines loses of each order."""
        error = _error(pattern, 1)
        knots = linear_knots(error, self.entries)
        closed = np.append(knots, knots[0])
        places = np.arange(self.entries + 1) / self.entries

        def table(angles: NDArray[np.uint32]) -> Array:
            return np.asarray(np.interp(angles / 2.0**32, places, closed))

        found = lost_orders(table, error, pattern.lines)
        return [{"order": float(k), "arcsec": lost} for k, lost in found.items()]


def _moved(error: Function, first: float) -> Function:
    return lambda x: error(x + first)


def _error(pattern: Pattern, direction: int) -> Function:
    """Error at true angles in turns, without the constant, travelling one way."""
    if not pattern.has_direction:

        def plain(x: Array) -> Array:
            return np.asarray(pattern.reading(x) - x - pattern.zero)

        return plain
    if pattern.model.argument == "indicated":
        raise ArgumentError(
            "a model with terms of direction and the indicated argument has no error at the true "
            "angle in one pass: fit it with --argument reference"
        )
    grid = np.arange(_GRID) / _GRID
    values = pattern.directed(grid, direction)
    closed, places = np.append(values, values[0]), np.append(grid, 1.0)

    def directed(x: Array) -> Array:
        return np.asarray(np.interp(x % 1.0, places, closed))

    return directed


def steepness(travel: Travel) -> tuple[float, float]:
    """Largest slope (deg per deg) and its change per degree: what an axis must follow."""
    h = 360.0 / travel.entries
    slopes = [np.diff(values) * 360.0 / h for values in (travel.forward, travel.reverse)]
    slope = max(float(np.max(np.abs(s))) for s in slopes)
    bend = max(float(np.max(np.abs(np.diff(s)), initial=0.0)) / h for s in slopes)
    return slope, bend
