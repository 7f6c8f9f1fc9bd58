"""Motion of the output: strokes between reversals with finite acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Points per second of motion used to invert travel to time; angles themselves are exact.
_GRID = 200


@dataclass(frozen=True)
class Motion:
    """Piecewise constant acceleration: from knot j on, theta_j + v_j dt + a_j dt^2 / 2."""

    time: Array
    theta: Array
    velocity: Array
    acceleration: Array
    stops: Array  # times at which a stroke ends
    corners: Array  # angles between which the motion is monotone, the start included

    def _locate(self, time: Array) -> tuple[NDArray[np.int64], Array]:
        knot = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 1)
        return knot, time - self.time[knot]

    def angle(self, time: Array) -> Array:
        """True output angle in degrees, unwrapped."""
        j, dt = self._locate(time)
        return np.asarray(self.theta[j] + dt * (self.velocity[j] + 0.5 * dt * self.acceleration[j]))

    def speed(self, time: Array) -> Array:
        """Signed velocity in degrees per second."""
        j, dt = self._locate(time)
        return np.asarray(self.velocity[j] + dt * self.acceleration[j])

    def since_reversal(self, time: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """Number of the one-way stretch, its direction, and the travel since it began.

        A reading taken at the very end of a stroke still belongs to that stroke.
        """
        directions = np.sign(np.diff(self.corners))
        turned = np.concatenate([[False], directions[1:] != directions[:-1]])
        stretch, begin = np.cumsum(turned), self.corners[:-1].copy()
        for j in np.flatnonzero(~turned[1:]) + 1:
            begin[j] = begin[j - 1]
        j = np.minimum(np.searchsorted(self.stops, time, side="left"), directions.size - 1)
        return stretch[j], directions[j], np.abs(self.angle(time) - begin[j])

    @property
    def stretches(self) -> list[tuple[float, float]]:
        """Direction and length in degrees of every one-way stretch."""
        found: list[tuple[float, float]] = []
        for step in np.diff(self.corners):
            sign = float(np.sign(step))
            if found and found[-1][0] == sign:
                found[-1] = (sign, found[-1][1] + abs(float(step)))
            else:
                found.append((sign, abs(float(step))))
        return found

    def times_at_travel(self, travel: Array, start: float) -> Array:
        """When the path covered since ``start`` reaches each value of ``travel`` in degrees."""
        end = float(self.time[-1])
        grid = np.linspace(start, end, max(1000, int(_GRID * (end - start))))
        grid = np.unique(np.concatenate([grid, self.stops[self.stops > start]]))
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.angle(grid))))])
        moving = np.concatenate([[True], np.diff(path) > 0.0])
        return np.asarray(np.interp(travel, path[moving], grid[moving]))


def strokes(
    start: float, lengths: Sequence[float], speed: float, acceleration: float, dwell: float
) -> Motion:
    """Move by each signed length in turn, at ``speed``, and rest for ``dwell`` s after each."""
    time, theta = 0.0, start
    knots: list[tuple[float, float, float, float]] = []
    stops, corners = [], [start]
    for length in lengths:
        sign = 1.0 if length > 0 else -1.0
        top = min(speed, np.sqrt(acceleration * abs(length)))
        ramp = top / acceleration
        cruise = abs(length) / top - ramp
        a = sign * acceleration
        for duration, v, slope in (
            (ramp, 0.0, a),
            (cruise, sign * top, 0.0),
            (ramp, sign * top, -a),
            (dwell, 0.0, 0.0),
        ):
            knots.append((time, theta, v, slope))
            theta += v * duration + 0.5 * slope * duration**2
            time += duration
            if slope == -a:
                stops.append(time)
        corners.append(theta)
    knots.append((time, theta, 0.0, 0.0))
    columns = np.array(knots).T
    return Motion(*columns, stops=np.array(stops), corners=np.array(corners))
