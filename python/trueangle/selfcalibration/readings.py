"""Readings of all stretches as one list, and the grids of knots laid over them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from ..support.arrays import Array
from .segments import Segment, ripple_lead
from .splines import Knots

#: Readings per knot of the finest grid, at least.
PER_KNOT: Final = 6

#: Smooth trends of a stretch at most: of polynomials of degree 2 to 8 a coasting shaft needs
#: no more; and the turns that each needs, so that none comes near an order.
_TRENDS: Final = 7
_TURNS_PER_TREND: Final = 5.0


class SegmentReadings:
    """Readings of all stretches in one list, with what does not change from fit to fit."""

    def __init__(self, stretches: Sequence[Segment]) -> None:
        self.stretches = list(stretches)
        self.size = sum(s.time.size for s in stretches)
        self.stretch = np.repeat(np.arange(len(stretches)), [s.time.size for s in stretches])
        self.time = np.concatenate([s.time for s in stretches])
        self.angle = np.concatenate([s.angle for s in stretches])
        speeds = [s.turn_speed() for s in stretches]
        self.speed = np.concatenate(speeds)
        self.mean_speed = float(np.exp(np.mean(np.log(self.speed))))
        #: How ripple of constant torque grows where the shaft is slow.
        self.ripple = (self.mean_speed / self.speed) ** 2
        self.lead = np.concatenate(
            [ripple_lead(s, v) for s, v in zip(self.stretches, speeds, strict=True)]
        )
        #: Smooth trends that a stretch may follow at no cost: one for every few turns.
        self.trends = tuple(min(_TRENDS, int(s.turns / _TURNS_PER_TREND)) for s in self.stretches)
        self.extra: Array | None = None  # further columns of motion, (r, n)
        self.extra_names: tuple[str, ...] = ()

    def knots(self, intervals: int) -> Knots:
        """A grid of about so many intervals in all, each stretch a power of two times some."""
        spans = [float(s.time[-1] - s.time[0]) for s in self.stretches]
        fewest = min(self.size // PER_KNOT, intervals)
        levels = max(0, math.floor(math.log2(max(fewest / (4 * len(spans)), 1.0))))
        unit = 2**levels
        spacing = max(max(spans) / unit, sum(spans) / max(fewest, 4)) if unit == 1 else 0.0
        if unit > 1:
            spacing = max(sum(spans) / fewest, max(spans) / (unit * 64))
        count = tuple(max(unit, unit * math.ceil(span / (spacing * unit))) for span in spans)
        spacing = max(span / n for span, n in zip(spans, count, strict=True))
        starts = tuple(
            # Shorter stretches stand in the middle of their knots.
            0.5 * (float(s.time[0]) + float(s.time[-1]) - n * spacing)
            for s, n in zip(self.stretches, count, strict=True)
        )
        return Knots(starts, count, spacing * (1.0 + 1e-9))

    def first_spline(self, knots: Knots) -> Array:
        """Coefficients near the readings themselves: their values at the knots."""
        at = knots.greville()
        parts = []
        for g, stretch in enumerate(self.stretches):
            here = at[knots.first[g] : knots.first[g + 1]]
            value = np.interp(here, stretch.time, stretch.angle)
            for outside, edge in ((here < stretch.time[0], 0), (here > stretch.time[-1], -1)):
                rate = 2.0 * math.pi * stretch.speed * stretch.direction
                value[outside] = stretch.angle[edge] + rate * (here[outside] - stretch.time[edge])
            parts.append(value)
        return np.concatenate(parts)
