"""Velocity of a stream of angles from its time stamps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..support.angles import wrap

__all__ = ["Velocity"]

Array = NDArray[np.float64]


class Velocity:
    """Backward differences of angle over time, carried over batches.

    Examples
    --------
    >>> velocity = Velocity(360.0)
    >>> velocity([358.0, 359.0, 1.0], [0.0, 0.5, 1.0])
    array([2., 2., 4.])
    >>> velocity([2.0, 2.0], [1.5, 1.5])
    array([2., 2.])
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._angle = self._time = np.nan
        self._last = np.nan

    @property
    def state(self) -> tuple[float, float, float]:
        """The last angle, time and velocity; NaN where there is none yet."""
        return self._angle, self._time, self._last

    @state.setter
    def state(self, numbers: tuple[float, float, float]) -> None:
        self._angle, self._time, self._last = numbers

    def __call__(self, angle: ArrayLike, time: ArrayLike) -> Array:
        """Velocity at every sample; samples that are not finite leave no trace."""
        x = np.asarray(angle, dtype=np.float64)
        t = np.asarray(time, dtype=np.float64)
        if x.shape != t.shape or x.ndim > 1:
            raise ArgumentError(
                f"time must have the shape of the angles {x.shape}, one dimension, got {t.shape}"
            )
        velocity = np.full(x.shape, np.nan).ravel()
        good = np.flatnonzero(np.isfinite(x.ravel() + t.ravel()))
        if good.size:
            x, t = x.ravel()[good], t.ravel()[good]
            steps = wrap(np.diff(x, prepend=self._angle), self._period)
            spans = np.diff(t, prepend=self._time)
            velocity[good] = self._filled(steps, spans)
            self._angle, self._time = float(x[-1]), float(t[-1])
            self._last = float(velocity[good[-1]])
        return velocity.reshape(np.shape(angle))

    def _filled(self, steps: Array, spans: Array) -> Array:
        """``steps / spans``; where no time has passed, the velocity before, else after."""
        usable = spans > 0.0
        rates = np.where(usable, steps, np.nan) / np.where(usable, spans, 1.0)
        places = np.flatnonzero(usable)
        if places.size == 0:
            return np.full(steps.size, 0.0 if np.isnan(self._last) else self._last)
        before = np.searchsorted(places, np.arange(steps.size), side="right") - 1
        filled = rates[places[np.maximum(before, 0)]]
        if not np.isnan(self._last):
            filled[before < 0] = self._last
        return filled
