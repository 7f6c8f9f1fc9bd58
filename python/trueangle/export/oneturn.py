"""What the tables of one turn of the output share: knots, the mean, the floor of rounding."""

from __future__ import annotations

import math

import numpy as np

from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .knots import linear_knots
from .pattern import TurnPattern


def one_turn_knots(
    pattern: TurnPattern, entries: int, target: str, fixed: bool, binary: bool = False
) -> Array:
    """Least-squares knots, in turns, of the correction of a reading.

    A table may have a ``fixed`` number of entries, or a ``binary`` one: a power of two.

    Raises
    ------
    ArgumentError
        Orders that the table cannot hold, or shafts of which it holds no whole turn.
    """
    pattern.check_one_turn(target)
    top = int(max(pattern.lines, default=0.0))
    least = 1 << (2 * top).bit_length() if binary else 2 * top + 1
    smallest = 'use `target="c"`' if fixed else f"use `entries={least}` or more"
    pattern.check_orders(entries, target, smallest)
    return linear_knots(pattern.correction, entries)


def without_mean(knots: Array, pattern: TurnPattern) -> tuple[Array, float]:
    """Knots with their mean removed, and what the table then leaves to the zero, in degrees."""
    mean = float(np.mean(knots))
    return knots - mean, (mean + pattern.zero) * 360.0


def rounding_floor(step: float) -> float:
    """Arcsec rms between two rounded numbers: two thirds of the variance of each."""
    return step / math.sqrt(18.0) * ARCSEC_PER_TURN
