"""An error along the way: as a function of the angle, for each direction of travel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...support.arrays import Array

#: Multiple of the typical step in angle above which a step is a gap.
GAP = 5.0


@dataclass(frozen=True)
class _MeanCurve:
    """Means of neighbouring readings over increasing angles."""

    angle: Array
    error: Array
    is_turn: bool
    step: float

    def at(self, angle: Array) -> tuple[Array, NDArray[np.bool_]]:
        where = np.mod(angle, 360.0) if self.is_turn else angle
        period = 360.0 if self.is_turn else None
        value = np.interp(where, self.angle, self.error, period=period)
        x = self.angle
        if self.is_turn:
            x = np.concatenate([[x[-1] - 360.0], x, [x[0] + 360.0]])
        after = np.clip(np.searchsorted(x, where), 1, x.size - 1)
        known = (x[after] - x[after - 1] <= GAP * self.step) | (where == x[after])
        known &= (where >= x[0] - self.step) & (where <= x[-1] + self.step)
        return value, known


@dataclass(frozen=True)
class TravelledError:
    """The error of a log over its angle.

    Parameters
    ----------
    angle, error : ndarray
        Degrees, the angle without jumps at a turn.
    direction : ndarray
        -1 or 1 of every reading; 0 before the first motion.
    """

    angle: Array
    error: Array
    direction: Array

    @property
    def has_both(self) -> bool:
        """The log moved both ways."""
        return bool((self.direction > 0).any() and (self.direction < 0).any())

    @property
    def step(self) -> float:
        """Typical distance of two readings."""
        steps = np.abs(np.diff(self.angle))
        return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0

    def at(self, angle: Array, direction: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Error at angles of a travel, and which of them the log covers.

        Over the log's whole travel where that holds these angles, else modulo a turn.
        """
        angle = angle + self._turns(angle)
        low, high = float(self.angle.min()) - self.step, float(self.angle.max()) + self.step
        is_outside = bool(angle.min() < low or angle.max() > high)
        # Part of a turn that may be missing in a log of a whole turn.
        is_turn = is_outside and high - low >= 0.98 * 360.0
        curves = self._curves(is_turn)
        error = np.zeros(angle.size)
        known = np.zeros(angle.size, dtype=bool)
        for sign in (-1, 1):
            rows = direction < 0 if sign < 0 else direction >= 0
            curve = curves.get(sign, next(iter(curves.values())))
            error[rows], known[rows] = curve.at(angle[rows])
        return error, known

    @property
    def std(self) -> float:
        """Scatter of the log's own readings about the curve, degrees: passes that differ."""
        error, _ = self.at(self.angle, self.direction)
        return float(np.std(self.error - error))

    def _turns(self, angle: Array) -> float:
        """Whole turns, in degrees, that bring angles to those of the log."""
        own, other = (0.5 * float(x.min() + x.max()) for x in (self.angle, angle))
        return 360.0 * round((own - other) / 360.0)

    def _curves(self, is_turn: bool) -> Mapping[int, _MeanCurve]:
        found = {}
        for sign in (-1, 1):
            rows = self.direction < 0 if sign < 0 else self.direction >= 0
            if rows.any():
                found[sign] = self._curve(rows, is_turn)
        return found

    def _curve(self, rows: NDArray[np.bool_], is_turn: bool) -> _MeanCurve:
        angle = np.mod(self.angle[rows], 360.0) if is_turn else self.angle[rows]
        step = self.step or 1.0
        bins, place, count = np.unique(
            np.floor(angle / step), return_inverse=True, return_counts=True
        )
        mean = np.bincount(place, angle, bins.size) / count
        error = np.bincount(place, self.error[rows], bins.size) / count
        return _MeanCurve(mean, error, is_turn, step)
