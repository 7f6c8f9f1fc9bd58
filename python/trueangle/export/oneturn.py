"""What the tables of one turn of the output have in common."""

from __future__ import annotations

import math
import re

import numpy as np

from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .knots import linear_knots
from .pattern import TurnPattern
from .reading import failed

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def one_turn_knots(pattern: TurnPattern, entries: int, target: str, fixed: bool) -> Array:
    """Least-squares knots, in turns, of the correction of a reading.

    Raises
    ------
    ArgumentError
        Orders that the table cannot hold, or shafts of which it holds no whole turn.
    """
    pattern.check_one_turn(target)
    top = int(max(pattern.lines, default=0.0))
    smallest = 'use `target="c"`' if fixed else f"use `entries={2 * top + 1}` or more"
    pattern.check_orders(entries, target, smallest)
    return linear_knots(pattern.correction, entries)


def without_mean(knots: Array, pattern: TurnPattern) -> tuple[Array, float]:
    """Knots with their mean removed, and what the table then leaves to the zero, in degrees."""
    mean = float(np.mean(knots))
    return knots - mean, (mean + pattern.zero) * 360.0


def rounding_floor(step: float) -> float:
    """Arcsec rms between two rounded numbers: two thirds of the variance of each."""
    return step / math.sqrt(18.0) * ARCSEC_PER_TURN


def longest_array(text: str, path: str, name: str) -> tuple[Array, int, int]:
    """Numbers of the longest brace list of a C source, the line it begins in, their decimals.

    Raises
    ------
    FileError
        There is none, or something in it is not a number.
    """
    plain = re.sub(r"//[^\n]*|/\*.*?\*/", lambda m: "\n" * m[0].count("\n"), text, flags=re.S)
    found = max(re.finditer(r"\{([^{}]*)\}", plain), key=lambda m: len(m[1]), default=None)
    if found is None:
        raise failed(path, f"holds no array in braces: the table of {name} is wanted")
    line = plain.count("\n", 0, found.start()) + 1
    numbers, decimals, at = [], 0, line
    for cell in re.split(r"(,)", found[1]):
        word = cell.strip().rstrip("fFuUlL")
        if cell != "," and word:
            if not _NUMBER.fullmatch(word) or not math.isfinite(float(word)):
                at += cell.count("\n", 0, len(cell) - len(cell.lstrip()))
                raise failed(path, f"{word[:30]!r} is not a number of a table", at)
            numbers.append(float(word))
            decimals = max(decimals, len(re.split(r"[eE]", word)[0].partition(".")[2]))
        at += cell.count("\n")
    if len(numbers) < 4:
        raise failed(path, f"a table of {len(numbers)} numbers is none of {name}", line)
    return np.array(numbers), line, decimals
