"""Sums of many units taken together in a few groups, each unit's own zero still taken out.

A normal matrix for each of a hundred thousand runs would take hours and all memory. What
evidence needs is a few dozen of them: their sum, and groups to hold out one by one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from ...support.arrays import Array
from .zerogroups import ZeroGroupReadings

#: With more than `MOST_UNITS` units they are combined into `GROUPS` groups.
MOST_UNITS: Final = 96
GROUPS: Final = 32


def units_in_groups(units: Sequence[ZeroGroupReadings]) -> list[list[int]]:
    """Units of each group, dealt in turn, so that a slow change is in all of them."""
    return [list(range(group, len(units), GROUPS)) for group in range(GROUPS)]


def _unit_means(units: Sequence[ZeroGroupReadings], orders: Array) -> Array:
    """Weighted means of cosines and sines of each order, a row a unit, for short units."""
    found = np.empty((len(units), 2 * orders.size))
    sizes = np.array([unit.turns.size for unit in units])
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    turns = np.concatenate([unit.turns for unit in units])
    turns -= np.floor(turns) if (orders == np.round(orders)).all() else 0.0
    weights = np.concatenate([unit.weights for unit in units])
    total = np.add.reduceat(weights, starts)
    steps = np.diff(orders, prepend=0.0)
    power = np.ones(turns.size, dtype=np.complex128)
    last, step = math.nan, power
    for i, (order, by) in enumerate(zip(orders.tolist(), steps.tolist(), strict=True)):
        # Powers of e^{ix} between two fresh evaluations.
        if i % 64 == 0 or by != last:
            phase = order * turns
            power = np.exp(2j * math.pi * (phase - np.round(phase)))
            step, last = np.exp(2j * math.pi * by * turns), by
        else:
            power = power * step
        mean = np.add.reduceat(weights * power, starts) / total
        found[:, i], found[:, i + orders.size] = mean.real, mean.imag
    return found


def sums_of_unit_means(units: Sequence[ZeroGroupReadings], orders: Array) -> Array:
    """``sum of weight x mean x mean'`` over the units, in blocks of them."""
    # Numbers in a block of units: small compared with the readings.
    size = max(1, (1 << 21) // (2 * orders.size))
    total = np.zeros((2 * orders.size, 2 * orders.size))
    for begin, end in pairwise([*range(0, len(units), size), len(units)]):
        block = units[begin:end]
        root = np.sqrt([float(unit.weights.sum()) for unit in block])
        scaled = _unit_means(block, orders) * root[:, None]
        total += scaled.T @ scaled
    return total
