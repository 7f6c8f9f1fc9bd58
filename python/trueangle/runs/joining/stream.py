"""One stream of a log: angles at times of its clock, sampled or logged on change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...support.arrays import Array, quantile

#: Readings that a run is made of, at least.
LEAST = 4
#: Times the typical step in time from which on a pause is a gap.
GAP = 5.0
#: Deviation from a line, in units of the readings' roughness, up to which a line suffices; times
#: at which it is tested, at most; and windows, at least.
_ROUGH, _LOOKED_AT, _WINDOWS = 3.0, 4096, 16
#: Longest pause over the typical step from which on a log without repeats is one on change.
PAUSE = 3.0


@dataclass(frozen=True, eq=False)
class Stream:
    """Angles at times.

    Parameters
    ----------
    time : ndarray
        Seconds of the stream's own clock, increasing.
    angle : ndarray
        Degrees, without jumps at a turn.
    """

    time: Array
    angle: Array

    @classmethod
    def of(cls, time: Array, angle: Array) -> Stream:
        """A stream of readings as they were logged: sorted in time, one for each time."""
        order = np.argsort(time, kind="stable")
        stamps, first, count = np.unique(time[order], return_index=True, return_counts=True)
        unwrapped = np.unwrap(angle[order], period=360.0)
        return cls(stamps, np.add.reduceat(unwrapped, first) / count)

    @cached_property
    def step(self) -> float:
        """Typical time between two readings."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else 0.0

    @cached_property
    def is_on_change(self) -> bool:
        """Whether a reading was logged only when it differed from the one before.

        Then it did not change by more than one step in any pause.
        """
        if self.time.size < 8:
            return False
        change, pause = np.diff(self.angle), np.diff(self.time)
        repeats = float(np.mean(change == 0.0))
        # Share of neighbours that may be equal in a log on change (time stamps collide).
        return repeats < 0.01 and float(pause.max()) > PAUSE * self.step and self.is_stepped

    @cached_property
    def is_stepped(self) -> bool:
        """Whether the steps after long pauses are as small as any: nothing moved meanwhile."""
        change, pause = np.abs(np.diff(self.angle)), np.diff(self.time)
        long = pause > PAUSE * self.step
        typical = float(np.median(change[~long])) if (~long).any() else 0.0
        return bool(long.any()) and float(np.median(change[long])) <= 2.0 * typical

    @cached_property
    def held(self) -> Stream:
        """The stream with its pauses filled by the last value, if it is one on change."""
        if not self.is_on_change:
            return self
        long = np.flatnonzero(np.diff(self.time) > PAUSE * self.step)
        time = np.insert(self.time, long + 1, self.time[long + 1] - self.step)
        return Stream(time, np.insert(self.angle, long + 1, self.angle[long]))

    @cached_property
    def resolution(self) -> float:
        """Standard deviation of an angle that is known to its smallest step only, degrees."""
        steps = np.abs(np.diff(self.angle))
        return float(np.min(steps[steps > 0.0], initial=np.inf)) / math.sqrt(12.0)

    @cached_property
    def bridged(self) -> float:
        """Longest pause that is interpolated over.

        Five typical steps; more where the readings over as long a time stray from the line
        between its ends by three times their own roughness at most, so that a log written in
        bursts has no gaps between them.
        """
        longest = length = GAP * self.step
        # Nine of ten of rounded readings are nearer than twice that to lines between two others.
        rough = max(self._off_line(2.0 * self.step) or 0.0, 2.0 * self.resolution)
        while 2.0 * _WINDOWS * length <= np.ptp(self.time):
            length *= 2.0
            off = self._off_line(length)
            if off is not None and off > _ROUGH * rough:
                break
            longest = longest if off is None else length
        return longest

    def _off_line(self, length: float) -> float | None:
        """Deviation of readings from lines between two that are ``length`` s apart, or None."""
        t = self.time
        first = np.arange(0, t.size, 1 + t.size // _LOOKED_AT)
        last = np.searchsorted(t, t[first] + length)
        first, last = first[last < t.size], last[last < t.size]
        whole = t[last] - t[first]
        middle = np.searchsorted(t, t[first] + 0.5 * whole)
        share = (t[middle] - t[first]) / whole
        used = (whole <= 2.0 * length) & (np.abs(share - 0.5) < 0.3)
        if np.count_nonzero(used) < _WINDOWS:
            return None
        line = self.angle[first] + share * (self.angle[last] - self.angle[first])
        return float(quantile(np.abs(self.angle[middle] - line)[used], 0.9))

    def gaps(self, longest: float | None) -> Array:
        """Start and end of every unknown pause, shape (n, 2)."""
        if self.is_on_change and longest is None:
            return np.empty((0, 2))
        limit = self.bridged if longest is None else longest
        places = np.flatnonzero(np.diff(self.time) > limit)
        return np.column_stack([self.time[places], self.time[places + 1]])

    def covers(self, time: Array, longest: float | None = None) -> NDArray[np.bool_]:
        """Which times lie within the stream and in none of its gaps."""
        # Part of a step by which a time may lie outside.
        edge = 1e-3 * self.step  # times are rounded on the way from one clock to the other
        inside = (time >= self.time[0] - edge) & (time <= self.time[-1] + edge)
        for start, end in self.gaps(longest):
            inside &= (time <= start) | (time >= end)
        return np.asarray(inside)

    @cached_property
    def is_cubic(self) -> bool:
        """Whether cubics through the neighbours predict held-out readings better than lines."""
        lines, cubics = (self._left_out(kind) for kind in (False, True))
        return bool(cubics.size) and float(np.median(cubics)) < float(np.median(lines))

    @cached_property
    def interpolation_std(self) -> float:
        """Standard deviation of what interpolation adds between two readings, degrees.

        From held-out readings, at twice the distance: a line's error grows with its square, a
        cubic's with its fourth power. The noise of readings is included.
        """
        left_out = self._left_out(self.is_cubic)
        if not left_out.size:
            return 0.0
        spread = 1.4826 * float(np.median(left_out))
        return spread / (16.0 if self.is_cubic else 4.0)

    def _left_out(self, cubic: bool) -> Array:
        """Distances of every other reading from the curve through the others."""
        held = self.held
        inner = np.arange(3, held.time.size - 3, 2)
        kept = Stream(held.time[::2], held.angle[::2])
        limit = self.bridged
        wide = held.time[inner + 1] - held.time[inner - 1] > limit
        inner = inner[~wide]
        if not inner.size:
            return np.empty(0)
        return np.abs(kept.at(held.time[inner], cubic)[0] - held.angle[inner])

    def at(self, time: Array, cubic: bool | None = None) -> tuple[Array, Array]:
        """Angle and velocity at times within the stream, by lines or by cubics."""
        held = self.held
        t, x = held.time, held.angle
        i = np.clip(np.searchsorted(t, time, side="right") - 1, 0, t.size - 2)
        h = t[i + 1] - t[i]
        u = (time - t[i]) / h
        slope = (x[i + 1] - x[i]) / h
        if not (self.is_cubic if cubic is None else cubic) or t.size < 4:
            return x[i] + u * (x[i + 1] - x[i]), slope
        rate = np.gradient(x, t)
        a, b = rate[i] - slope, rate[i + 1] - slope
        value = x[i] + h * u * (slope + (1.0 - u) * ((1.0 - u) * a - u * b))
        velocity = slope + (1.0 - u) * (1.0 - 3.0 * u) * a - u * (2.0 - 3.0 * u) * b
        return value, velocity
