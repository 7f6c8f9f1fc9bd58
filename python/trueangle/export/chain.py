"""Several shafts without iteration: a chain of inverted tables, slow shaft first.

Subtract the output's table, then look up the motor's table, inverted beforehand as a function
of its own reading, at what is left. One look-up a shaft, and what the order neglects is the
slope of the slow pattern times the fast one: 0.03 arcsec where one pass of the plain error
leaves 4.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pattern import Pattern
from .table import TURN, Table, make_table

__all__ = ["Chain", "identifier", "make_chain"]

Array = NDArray[np.float64]
Angles = NDArray[np.uint32]


@dataclass(frozen=True)
class Chain:
    """Tables and the order in which a device takes them.

    Attributes
    ----------
    zero : int
        2^-32 turns that are subtracted first: the model's constant.
    tables : tuple of Table
        Slow shafts first.
    at_indicated : bool
        The model's argument is the indicated angle: all are looked up at the reading.
    """

    zero: int
    tables: tuple[Table, ...]
    at_indicated: bool

    @property
    def whole(self) -> bool:
        """Whether one angle of the output is enough to find every table's place."""
        return all(table.cycles == int(table.cycles) for table in self.tables)

    def corrected(self, angles: Angles, contracted: bool = False) -> Angles:
        """True angles behind indicated ones, both in 2^-32 turns."""
        left = angles - np.uint32(self.zero % 2**32)
        start = left
        for table in self.tables:
            at = (start if self.at_indicated else left) * np.uint32(int(table.cycles))
            left = left - table.correction(at, contracted).astype(np.uint32)
        return left

    def correction(self, angles: Angles, contracted: bool = False) -> Array:
        """What is subtracted in all, less the zero, in turns."""
        taken = angles - self.corrected(angles, contracted) - np.uint32(self.zero % 2**32)
        return taken.astype(np.int32) / TURN


def make_chain(pattern: Pattern, method: str, number: str, entries: int | Sequence[int]) -> Chain:
    """Tables of every shaft of a pattern; one number of entries for all, or one each."""
    shafts = pattern.shafts()
    sizes = [entries] * len(shafts) if isinstance(entries, int) else list(entries)
    at_indicated = pattern.model.argument == "indicated"
    tables: list[Table] = []
    zero = round(pattern.zero * TURN)
    for (name, cycles, part), size in zip(shafts, sizes, strict=True):
        # Looked up at the zeroed reading: the place of an indicated-argument pattern moves.
        move = pattern.zero * cycles if at_indicated else 0.0

        def moved(x: Array, part: Pattern = part, move: float = move) -> Array:
            return part.correction(x + move)

        name = _unlike(name, [table.shaft for table in tables])
        tables.append(make_table(name, cycles, moved, method, number, size))
    return Chain(zero, tuple(tables), at_indicated)


def identifier(name: str) -> str:
    """A name that C and Rust take: lower case, digits and underscores.

    Examples
    --------
    >>> identifier("Joint-A 3"), identifier("3rd")
    ('joint_a_3', 'angle_3rd')
    """
    found = re.sub(r"[^0-9a-z]+", "_", name.lower()).strip("_")
    return found if found and found[0].isalpha() else f"angle_{found}".rstrip("_")


def _unlike(name: str, others: Sequence[str]) -> str:
    """The name as an identifier, with a number where another shaft has the same."""
    plain, number = identifier(name), 2
    found = plain
    while found in others:
        found, number = f"{plain}_{number}", number + 1
    return found
