"""Uniform grids of positions and the orders that are collinear on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Departure from the grid, in shares of its step, up to which readings lie on it.
ON_GRID = 0.02

#: Positions beyond which a grid is not looked for.
MOST_POSITIONS = 10_000

#: Positions that part of a grid has at least, and share of those between its ends.
LEAST_OF_ARC, FILLED = 6, 0.5


@dataclass(frozen=True)
class UniformGrid:
    """Equal steps of one turn."""

    positions: int

    def folded(self, order: float) -> float:
        """The lowest order with the same values at the positions.

        Examples
        --------
        >>> UniformGrid(36).folded(202)
        14
        """
        return folded_order(order, self.positions)

    def aliases(self, order: float, count: int) -> list[float]:
        """Further orders with the same values, ascending."""
        return aliases_of(order, self.positions, count)


def folded_order(order: float, rate: float) -> float:
    """The lowest order with the same values at ``rate`` equal steps a turn."""
    rest = order % rate
    return min(rest, rate - rest)


def aliases_of(order: float, rate: float, count: int) -> list[float]:
    """Further orders with the same values, ascending."""
    low = folded_order(order, rate)
    found = sorted({abs(s * low + k * rate) for k in range(count + 2) for s in (1, -1)})
    return [m for m in found if m != order][:count]


def uniform_grid(theta: NDArray[np.float64]) -> UniformGrid | None:
    """The uniform grid that all angles (radians) lie on, or None.

    Equal steps that close after a turn, or an arc of them, with gaps allowed: at a polygon's places
    the same orders are collinear wherever the joint stops.

    Examples
    --------
    >>> uniform_grid(np.radians(np.arange(40.0, 240.0, 10.0)))
    UniformGrid(positions=36)
    >>> uniform_grid(np.radians([3.0, 41.0, 77.0, 122.0])) is None
    True
    """
    turns = np.sort(np.mod(theta / (2.0 * np.pi), 1.0))
    # Positions are groups of angles closer than the finest grid looked for.
    gaps = np.diff(np.append(turns, turns[0] + 1.0))
    steps = gaps[gaps > 0.2 / MOST_POSITIONS]
    if not 3 <= steps.size <= MOST_POSITIONS:
        return None
    if _lies_on(turns, steps.size):
        return UniformGrid(steps.size)
    # Readings cut to a last digit lie on a lattice too: what is filled by half is a design.
    positions = round(1.0 / float(steps.min()))
    on_arc = positions * (1.0 - float(steps.max())) + 1.0
    filled = LEAST_OF_ARC <= steps.size >= FILLED * on_arc
    if filled and positions <= MOST_POSITIONS and _lies_on(turns, positions):
        return UniformGrid(positions)
    return None


def _lies_on(turns: NDArray[np.float64], positions: int) -> bool:
    """Whether all places, in turns, lie on a grid of ``positions`` equal steps."""
    shift = np.angle(np.mean(np.exp(2j * np.pi * positions * turns))) / (2.0 * np.pi)
    away = turns * positions - shift
    return float(np.abs(away - np.round(away)).max()) < ON_GRID
