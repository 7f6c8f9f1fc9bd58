"""Several shafts without iteration: a chain of inverted tables, slow shaft first.

Subtract the output's table, then look up the motor's table, inverted beforehand as a
function of its own reading, at the result. This needs one look-up a shaft. The sequence neglects
the slope of the slow pattern times the fast one: 0.03 arcsec, where one pass of the plain error
leaves 4.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..runs.rawchannels import Channels
from ..support.arrays import Array
from .pattern import TurnPattern
from .table import TURN, Table, make_table

Angles = NDArray[np.uint32]
Places = NDArray[np.int64] | Angles


@dataclass(frozen=True)
class Chain:
    """Tables and the order in which a device takes them.

    Attributes
    ----------
    zero : int
        2^-32 turns that are subtracted first: the model's constant, whole turns kept.
    tables : tuple of Table
        Slow shafts first.
    at_indicated : bool
        The model's argument is the indicated angle: all are looked up at the reading.
    channels : Channels, optional
        Of which the indicated angle is decoded.
    """

    zero: int
    tables: tuple[Table, ...]
    at_indicated: bool
    channels: Channels | None = None

    @property
    def whole(self) -> bool:
        """Whether one angle of the output is enough to find every table's place."""
        return all(table.cycles == int(table.cycles) for table in self.tables)

    @property
    def turns(self) -> tuple[int, bool]:
        """Output turns to look at, and whether every table is back at its start after them."""
        shared = 1
        for table in self.tables:
            ratio = Fraction(table.cycles).limit_denominator(_MOST_TURNS)
            # Of a ratio that is a fraction: its rounding in a double.
            if abs(float(ratio) - table.cycles) > 1e-15 * table.cycles:
                return _TURNS, False
            shared = math.lcm(shared, ratio.denominator)
        return (shared, True) if shared <= _MOST_TURNS else (_TURNS, False)

    def corrected(self, angles: Angles, contracted: bool = False) -> Angles:
        """True angles behind indicated ones, both in 2^-32 turns."""
        return self.corrected_unwrapped(angles, contracted).astype(np.uint32)

    def corrected_unwrapped(self, places: Places, contracted: bool = False) -> Places:
        """True angles behind indicated ones, with their turns, in 2^-32 turns."""
        left = np.asarray(places).astype(np.int64) - self.zero
        start = left
        for table in self.tables:
            at = table.place(start if self.at_indicated else left)
            left = left - table.correction(at, contracted)
        return left

    def correction(self, places: Places, contracted: bool = False) -> Array:
        """What is subtracted in all, in turns."""
        taken = np.asarray(places).astype(np.int64) - self.corrected_unwrapped(places, contracted)
        return np.asarray(taken / TURN)


#: Turns after which shafts may be back together, and those looked at of shafts that never are.
_MOST_TURNS = 64
_TURNS = 16


def make_chain(
    pattern: TurnPattern, method: str, number: str, entries: int | Sequence[int]
) -> Chain:
    """Tables of every shaft of a pattern; one number of entries for all, or one each."""
    shafts = pattern.shafts()
    sizes = [entries] * len(shafts) if isinstance(entries, int) else list(entries)
    at_indicated = pattern.model.argument == "indicated"
    tables: list[Table] = []
    zero = round(pattern.zero * TURN)
    for (name, cycles, part), size in zip(shafts, sizes, strict=True):
        # Looked up at the zeroed reading: the place of an indicated-argument pattern moves.
        move = pattern.zero * cycles if at_indicated else 0.0

        def moved(x: Array, part: TurnPattern = part, move: float = move) -> Array:
            return part.correction(x + move)

        name = _unlike(name, [table.shaft for table in tables])
        tables.append(make_table(name, cycles, moved, method, number, size))
    return Chain(zero, tuple(tables), at_indicated)


def source_identifier(name: str) -> str:
    """A name that C and Rust take: lower case, digits and underscores.

    Examples
    --------
    >>> source_identifier("Joint-A 3"), source_identifier("3rd")
    ('joint_a_3', 'angle_3rd')
    """
    found = re.sub(r"[^0-9a-z]+", "_", name.lower()).strip("_")
    return found if found and found[0].isalpha() else f"angle_{found}".rstrip("_")


def _unlike(name: str, others: Sequence[str]) -> str:
    """The name as an identifier, with a number where another shaft has the same."""
    plain, number = source_identifier(name), 2
    found = plain
    while found in others:
        found, number = f"{plain}_{number}", number + 1
    return found
