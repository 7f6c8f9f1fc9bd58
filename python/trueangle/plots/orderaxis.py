"""Axes of orders: true distances within a group, breaks between the groups of the shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from ..support.arrays import Array
from .palette import ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Orders between which nothing was looked at over so many orders stand in groups of their own.
_BREAK: Final = 12.0
#: Groups side by side at most; more would leave no width for each.
_MOST_GROUPS: Final = 6
#: Width of a group of one order, and the gap between two, in the unit of `_width`.
_LEAST, _GAP = 2.5, 1.0
#: Inches that a tick needs, and each digit at it.
_TICK_INCHES, _DIGIT_INCHES = 0.12, 0.09


def order_groups(orders: Sequence[float]) -> list[tuple[float, float]]:
    """First and last order of every group; groups are broken at the widest gaps.

    Examples
    --------
    >>> order_groups([1, 2, 5, 100, 101, 202])
    [(1.0, 5.0), (100.0, 101.0), (202.0, 202.0)]
    """
    ascending = np.unique(np.asarray(orders, dtype=np.float64))
    gaps = np.diff(ascending)
    wide = [int(i) for i in np.argsort(-gaps) if gaps[i] > _BREAK][: _MOST_GROUPS - 1]
    edges = [0, *sorted(i + 1 for i in wide), ascending.size]
    return [(float(ascending[a]), float(ascending[b - 1])) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class OrderAxis:
    """Where orders stand on one axis with breaks.

    Attributes
    ----------
    groups : list of (float, float)
        First and last order of every group.
    starts, scales : list of float
        Place of every group's first order, and places for one order within it.
    """

    groups: list[tuple[float, float]]
    starts: list[float]
    scales: list[float]

    @classmethod
    def of(cls, orders: Sequence[float]) -> OrderAxis:
        """The axis of some orders; a group is as wide as the root of what it spans."""
        groups = order_groups(orders)
        starts, scales, at = [], [], 0.0
        for low, high in groups:
            width = max(math.sqrt(high - low), _LEAST) if high > low else _LEAST
            margin = 0.06 * width
            starts.append(at + margin + (0.5 * (width - 2.0 * margin) if high == low else 0.0))
            scales.append((width - 2.0 * margin) / (high - low) if high > low else 1.0)
            at += width + _GAP
        return cls(groups, starts, scales)

    def places(self, orders: ArrayLike) -> Array:
        """Where orders stand."""
        wanted = np.asarray(orders, dtype=np.float64)
        group = np.searchsorted([low for low, _ in self.groups], wanted, side="right") - 1
        first = np.array([low for low, _ in self.groups])[group]
        return np.asarray(
            np.array(self.starts)[group] + np.array(self.scales)[group] * (wanted - first)
        )

    def width(self, orders: ArrayLike) -> Array:
        """Widths of bars that do not touch."""
        place = np.sort(self.places(orders))
        least = float(np.diff(place).min(initial=0.5))
        return np.full(place.size, 0.75 * min(least, 0.5))

    def room(self, ax: Axes, inches: float) -> float:
        """Places that so many inches take on these axes."""
        figure = ax.get_figure(root=True)
        wide = ax.get_position().width * figure.get_figwidth()  # type: ignore[union-attr]
        return inches * sum(self._spans()) / wide

    def draw(self, ax: Axes) -> None:
        """Ticks at whole orders, and marks where the axis is broken."""
        ticks: list[float] = []
        share = 1.0 / self.room(ax, 1.0)
        for (low, high), span in zip(self.groups, self._spans(), strict=True):
            room = _TICK_INCHES + _DIGIT_INCHES * len(f"{high:g}")
            most = max(2, int(share * span / room)) if high > low else 1
            ticks += _whole_ticks(low, high, most)
        ax.set_xticks(self.places(ticks), [f"{m:g}" for m in ticks])
        if max(ticks, default=0.0) >= 100.0:
            ax.tick_params(axis="x", labelsize="small")
        ends = self.places([high for _, high in self.groups])
        ax.set_xlim(self.starts[0] - 0.8, float(ends[-1]) + 0.8)
        for end, start in _pairwise_gaps(ends, self.starts):
            middle = 0.5 * (end + start)
            for side in (-0.09, 0.09):
                ax.plot(
                    [middle + side - 0.09, middle + side + 0.09],
                    [-0.025, 0.025],
                    transform=ax.get_xaxis_transform(),
                    color=ink(ax),
                    linewidth=1.0,
                    clip_on=False,
                    label="_break",
                )
            ax.axvline(middle, color=ink(ax) + "30", linewidth=0.8, linestyle=":", zorder=0.0)

    def _spans(self) -> list[float]:
        return [
            max((high - low) * scale, _LEAST)
            for (low, high), scale in zip(self.groups, self.scales, strict=True)
        ]


def _pairwise_gaps(ends: Array, starts: Sequence[float]) -> list[tuple[float, float]]:
    """End of each group and start of the next."""
    return [(float(end), float(start)) for end, start in zip(ends[:-1], starts[1:], strict=True)]


def _whole_ticks(low: float, high: float, most: int) -> list[float]:
    """Whole orders from ``low`` to ``high``, both named, at a step of 1, 2 or 5 times ten."""
    if high == low:
        return [low]
    steps = (m * 10**e for e in range(6) for m in (1, 2, 5))
    step = next(s for s in steps if (high - low) / s <= most)
    inner = [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
    kept = [float(k) for k in inner if low + 0.6 * step <= k <= high - 0.6 * step]
    return [low, *kept, high]
