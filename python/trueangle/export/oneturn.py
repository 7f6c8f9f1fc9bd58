"""What the tables of one turn of the output share: knots, the mean, the floor of rounding."""

from __future__ import annotations

import math

import numpy as np

from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .knots import linear_knots
from .pattern import TurnPattern


def one_turn_knots(
    pattern: TurnPattern, entries: int, target: str, most: int = 0, binary: bool = False
) -> Array:
    """Least-squares knots, in turns, of the correction of a reading.

    A table may have up to ``most`` entries (0: no other number), or a ``binary`` number of them: a
    power of two.

    Raises
    ------
    ArgumentError
        Orders that the table cannot hold, or shafts of which it holds no whole turn.
    """
    pattern.check_one_turn(target)
    least = pattern.least_entries()
    pattern.check_orders(entries, target, 1 << (least - 1).bit_length() if binary else least, most)
    return linear_knots(pattern.correction, entries)


def without_mean(knots: Array, pattern: TurnPattern) -> tuple[Array, float]:
    """Knots with their mean removed, and what the table then leaves to the zero, in degrees."""
    mean = float(np.mean(knots))
    return knots - mean, (mean + pattern.zero) * 360.0


def rounding_floor(step: float) -> float:
    """Arcsec rms between two rounded numbers: two thirds of the variance of each."""
    return step / math.sqrt(18.0) * ARCSEC_PER_TURN
