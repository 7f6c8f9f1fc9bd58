"""Counting turns of an angle that jumps at 0/period, over borders of batches and files."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array


class TurnState(NamedTuple):
    """Where a record stopped: the last angle read and the turns counted up to it."""

    last: float | None = None
    turns: int = 0


class TurnSpan(NamedTuple):
    """First angle, last angle and turns between them of readings counted by themselves."""

    period: float
    first: float | None
    last: float | None
    turns: int

    def after(self, state: TurnState) -> TurnState:
        """The state at their end when they follow ``state``."""
        if self.first is None or self.last is None:
            return state
        step = 0.0 if state.last is None else self.first - state.last
        return TurnState(self.last, state.turns - round(step / self.period) + self.turns)


class TurnCounter:
    """Turns to add to angles so that no step is longer than half a turn.

    ::

        n_i = n_{i-1} - round((x_i - x_{i-1}) / p)

    Only models whose error does not repeat after one turn need it. NaN is stepped over.

    ``state`` is where the batch or file before stopped; the first reading ever is in turn 0.

    Examples
    --------
    >>> counter = TurnCounter(360.0)
    >>> counter.count(np.array([350.0, 359.0]))
    array([0., 0.])
    >>> counter.count(np.array([1.0, np.nan, 358.0]))
    array([1., 1., 0.])
    """

    def __init__(self, period: float, state: TurnState | None = None) -> None:
        self.period = period
        self.state = state or TurnState()

    def count(self, angle: NDArray[np.floating]) -> Array:
        """Turns of every angle of the next batch; whole numbers."""
        x = np.asarray(angle, dtype=np.float64)
        last, turns = self.state
        known = np.flatnonzero(np.isfinite(x))
        if known.size == 0:
            return np.full(x.shape, float(turns))
        if known.size < x.size:
            # Every gap takes the reading before it; what comes first, the one from before.
            place = np.zeros(x.size, dtype=np.intp)
            place[known] = known
            place = np.maximum.accumulate(place)
            x = x[place]
            x[: known[0]] = x[known[0]] if last is None else last
        steps = np.diff(x, prepend=x[0] if last is None else last)
        counted = turns - np.cumsum(np.rint(steps / self.period))
        self.state = TurnState(float(x[-1]), int(counted[-1]))
        return np.asarray(counted)
