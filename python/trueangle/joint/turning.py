"""Direction and speed of readings about a turning point, where only the reference determines them.

The step that leads to the reading farthest out may hold the turning point: the joint then moves
the other way already. Of the two lines that the readings before and after it make in time,

::

    θ₋(t), θ₊(t),

it belongs to the one that predicts its angle. A difference of angles across the turning point is no
speed either: the last reading before it and the first one after it have the slope of the
parabola through the readings on their own side.
"""

from __future__ import annotations

import itertools

import numpy as np

from ..support.arrays import Array

#: Readings that make a line, and a parabola.
LINE, PARABOLA = 2, 3


def direction_at_turns(angle: Array, clock: Array, direction: Array) -> Array:
    """Directions of the steps, corrected for readings taken after the turning point.

    ``angle`` is unwrapped, ``clock`` holds times, or places in the record where none were recorded,
    and ``direction`` is that of the step that led to each reading.

    Examples
    --------
    >>> clock = np.arange(7.0)
    >>> angle = 10.0 - 4.0 * np.abs(clock - 2.8)
    >>> steps = np.sign(np.diff(angle, prepend=-np.inf))
    >>> steps.tolist()
    [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
    >>> direction_at_turns(angle, clock, steps).tolist()
    [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0]
    """
    found = direction.copy()
    edges = _edges(direction)
    for begin, turn, end in zip(edges[:-2], edges[1:-1], edges[2:], strict=True):
        k = turn - 1
        if k - begin < LINE or end - turn < LINE:
            continue
        before = _at(clock[k], clock[k - LINE : k], angle[k - LINE : k])
        after = _at(clock[k], clock[turn : turn + LINE], angle[turn : turn + LINE])
        # Share of the one line's error below which the other one's must be to claim the reading:
        # where both are similar the joint may have stopped there, and the direction stays.
        if abs(angle[k] - after) < 0.5 * abs(angle[k] - before):
            found[k] = direction[turn]
    return found


def velocity_at_turns(angle: Array, time: Array, direction: Array, velocity: Array) -> Array:
    """Velocities by central differences, corrected next to turning points.

    Examples
    --------
    >>> time = np.arange(8.0)
    >>> angle = 10.0 - 4.0 * np.abs(time - 3.4)
    >>> velocity = np.gradient(angle, time)
    >>> direction = np.where(time < 3.4, 1.0, -1.0)
    >>> velocity_at_turns(angle, time, direction, velocity).round(9).tolist()
    [4.0, 4.0, 4.0, 4.0, -4.0, -4.0, -4.0, -4.0]
    """
    found = velocity.copy()
    for begin, end in itertools.pairwise(_edges(direction)):
        if end - begin < PARABOLA:
            continue
        if begin > 0:
            found[begin] = _slope(time[begin : begin + PARABOLA], angle[begin : begin + PARABOLA])
        if end < angle.size:
            last = slice(end - 1, end - PARABOLA - 1 if end > PARABOLA else None, -1)
            found[end - 1] = _slope(time[last], angle[last])
    return found


def _edges(direction: Array) -> list[int]:
    cuts = np.flatnonzero(np.diff(direction)) + 1
    return [0, *cuts.tolist(), direction.size]


def _at(when: float, time: Array, angle: Array) -> float:
    """The line through two readings at another time; through the nearer where they are one."""
    apart = float(time[1] - time[0])
    slope = float(angle[1] - angle[0]) / apart if apart != 0.0 else 0.0
    return float(angle[0]) + slope * (when - float(time[0]))


def _slope(time: Array, angle: Array) -> float:
    """Slope at the first of three readings of the parabola through them."""
    a, b = float(time[1] - time[0]), float(time[2] - time[0])
    if a == 0.0 or b in (0.0, a):
        return float(angle[2] - angle[0]) / b if b != 0.0 else 0.0
    first, second = float(angle[1] - angle[0]) / a, float(angle[2] - angle[0]) / b
    return first + (first - second) * a / (b - a)
