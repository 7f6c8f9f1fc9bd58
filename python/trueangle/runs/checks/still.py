"""Readings that do not change while the other channel moves: at a limit, or repeated.

A column is also constant when the joint rests, when a command waits for the joint to follow,
and between two counts. So a constant column is a fault only by what it does when it goes on:

- after *repeated* readings the next new one has moved as far as the other column did since the
  last new one, while the joint was moving throughout;
- a column at a *limit* is at one end of its range, the joint passes by in the same motion
  before and after, and the column leaves the limit where it met it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ...support.angles import wrap
from ...support.arrays import Array, median, quantile
from ...support.layout import counted
from .fault import DataFault
from .record import Record

#: How far the other channel must have moved: in standard deviations of noise (a probability of
#: 1e-9), in counts of a column with a lattice, and in steps that only look like counts.
_FAR: Final = 6.0
_COUNTS: Final = 1.5
_STEPS: Final = 2.5


#: Readings in a row at an end of the range that are a limit.
_LEAST_STUCK: Final = 5

#: Readings of a column that is sampled and held at most; a command is held for longer.
_HELD: Final = 10

#: Speeds are equal within this factor, and a movement is made up for to within this part
#: (errors that change with the angle) and the noise.
_ALIKE: Final = 0.3
_MADE_UP: Final = 0.15


#: Share of its range that a channel must have gone onward, and not to and fro.
_ONWARD: Final = 0.7

#: Readings on both sides whose speeds are compared.
_BESIDE: Final = 5

#: Repeats are the exception below this share of readings, and the rule where this share of them
#: is equally long.
_RARE: Final = 0.2
_RULE: Final = 0.9


class _AnglePair(NamedTuple):
    """One column, the other, and the speed of the other at every step."""

    own: Array
    other: Array
    speed: Array
    least: float
    """How far the other must move."""
    apart: tuple[float, float]
    """Smallest and largest difference of the two where ``own`` is not constant for long."""


def stuck_readings(records: list[Record]) -> Iterator[DataFault]:
    """Readings that do not change while the other channel moves: at a limit, or stale."""
    for record in records:
        read = record.reference, record.indicated
        if not any(np.any(angle[1:] == angle[:-1]) for angle in read):
            continue  # before they are unwrapped, which takes longer
        reference, indicated = record.unwrapped
        for name, own, other in (
            ("indicated", indicated, reference),
            ("reference", reference, indicated),
        ):
            yield from _stuck(record, name, own, other)


def _stuck(record: Record, name: str, own: Array, other: Array) -> Iterator[DataFault]:
    if own.size < 2 * _LEAST_STUCK or np.ptp(own) == 0.0:
        return
    still = np.concatenate([[False], np.diff(own) == 0.0])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    # From the reading before to the last that repeats it.
    first, last = edges[::2] - 1, edges[1::2] - 1
    apart = (own - other)[~_within(first, last, last - first >= _LEAST_STUCK, own.size)]
    channels = _AnglePair(
        own,
        other,
        _speeds(other, record.time),
        _least(own, other, last - first),
        (float(apart.min()), float(apart.max())) if apart.size else (0.0, 0.0),
    )
    limit: list[int] = []
    stale: list[int] = []
    times = 0
    passed = np.abs(other[last] - other[first])
    long = last - first >= _LEAST_STUCK
    ends = own.min(), own.max()
    for i in np.flatnonzero((passed >= channels.least) | long).tolist():
        a, b = int(first[i]), int(last[i])
        if own[a] in ends and long[i] and _is_limit(channels, a, b):
            limit += range(a + 1, b + 1)
        elif passed[i] >= channels.least and _is_stale(channels, a, b):
            stale += range(a + 1, b + 1)
            times += 1
    if limit:
        yield record.fault(
            "saturated_travel",
            limit,
            f"the {name} angle of {record.name} stays at {own[limit[0]]:g} deg, the end of its "
            f"range, in {counted(limit, 'reading')} (first: {limit[0] + 1}) while the joint moves",
            "remove these readings, or measure inside the range",
        )
    # Rows from which on stale readings are a fault of the data and no coincidence, where they come
    # more than once; at one place a command that is held would do.
    if len(stale) >= (3 if times > 1 else _HELD):
        yield stale_fault(record, name, stale)


def stale_fault(record: Record, name: str, at: Sequence[int]) -> DataFault:
    """Readings of a column that repeat the one before."""
    return record.fault(
        "stale_samples",
        at,
        f"the {name} angle of {record.name} does not change in {counted(at, 'reading')} "
        f"(first: {record.number(at[0])}) while the joint moves: the log repeats old samples",
        "remove these readings, as `fit` and `diagnose` do, or log each sample once, with its time",
    )


def _within(
    first: NDArray[np.intp], last: NDArray[np.intp], which: NDArray[np.bool_], size: int
) -> NDArray[np.bool_]:
    """Readings that lie in one of the spans ``first .. last``."""
    edges = np.zeros(size + 1, dtype=np.int64)
    edges[first[which]] += 1
    edges[last[which] + 1] -= 1
    return np.asarray(np.cumsum(edges)[:-1] > 0)


def _least(own: Array, other: Array, lengths: NDArray[np.intp]) -> float:
    """Travel of the other channel that noise and counts of this one do not explain."""
    slip = np.diff(own - other)
    noise = 1.4826 * float(median(np.abs(slip - median(slip))))
    mine, beside = (_core.sensor_count(own - other, angle, 360.0) for angle in (own, other))
    if mine == 0.0 and int(lengths.sum()) > _RARE * own.size:
        repeats = float(np.mean(lengths == median(lengths)))
        if repeats < _RULE:  # counts that are not of one size
            steps = np.abs(np.diff(own))
            mine = _STEPS / _COUNTS * float(quantile(steps[steps > 0.0], 0.01))
    return _FAR * noise + _COUNTS * mine + beside


def _speeds(other: Array, time: Array | None) -> Array:
    """Travel per second, or per reading where time is not known."""
    steps = np.diff(other)
    dt = np.ones_like(steps) if time is None else np.diff(time)
    return np.divide(steps, dt, out=np.zeros_like(steps), where=dt > 0.0)


def _is_stale(c: _AnglePair, a: int, b: int) -> bool:
    """Whether ``own`` makes up after reading ``b`` for what it missed since reading ``a``."""
    if b + 1 == c.own.size:
        return b - a >= _LEAST_STUCK and _moves_on(c, a, b)
    missed = float(c.other[b] - c.other[a])
    near = _MADE_UP * abs(missed) + 0.4 * c.least
    made_up = float(c.own[b + 1] - c.own[b]) - float(c.other[b + 1] - c.other[b])
    if abs(wrap(made_up - missed, 360.0)) > near:
        return False
    if b - a >= _LEAST_STUCK:  # excludes a joint that was at rest when the column went on
        passes = a == 0 or _passes(c, a, b - a, 1)
        if not (passes and _passes(c, b, b - a, -1)):
            return False
    elif abs(missed) < _ONWARD * float(np.ptp(c.other[a : b + 1])) or not _alike(
        float(c.speed[b : b + 2].mean()), float(c.speed[a:b].mean())
    ):
        return False
    if a > 0:
        before = float(c.own[a] - c.own[a - 1]) - float(c.other[a] - c.other[a - 1])
        if abs(wrap(before, 360.0)) <= near:
            return True  # the reading before it was new
    size = np.abs(c.speed[a : b + 1])
    return b - a < _HELD and bool(size.min() >= _ALIKE * size.max())


def _is_limit(c: _AnglePair, a: int, b: int) -> bool:
    """Whether the joint passes by while ``own`` is at an end of its range."""
    if a == 0 or b + 1 == c.own.size:
        return _moves_on(c, a, b)
    if not (_passes(c, a, b - a, 1) and _passes(c, b, b - a, -1)):
        return False
    beyond = float(np.abs(c.other[a : b + 1] - c.other[a]).max())
    # It meets and leaves the limit between two readings each.
    step = float(np.abs(np.diff(c.other[[a - 1, a, b, b + 1]])[[0, 2]]).sum())
    back = abs(float(c.other[b] - c.other[a]))
    return beyond >= c.least and back <= _MADE_UP * beyond + step + 0.4 * c.least


def _moves_on(c: _AnglePair, a: int, b: int) -> bool:
    """Whether the joint moves while ``own`` is constant to the last reading, or from the first.

    A joint that catches up with a stopped command comes to rest, no farther from it than it has
    been before.
    """
    passed = abs(float(c.other[b] - c.other[a]))
    if passed < c.least or (a == 0 and b + 1 == c.own.size):
        return False
    at, far = (b, slice(a, a + _BESIDE)) if a == 0 else (a, slice(b - _BESIDE, b))
    if not _passes(c, at, b - a, 1 if at == a else -1):
        return False
    apart = float((c.own - c.other)[a if a == 0 else b])
    low, high = c.apart
    beyond = apart < low - c.least or apart > high + c.least
    near = slice(b, b + _BESIDE) if a == 0 else slice(a - _BESIDE if a > _BESIDE else 0, a)
    moving = _alike(float(c.speed[far].mean()), float(c.speed[near].mean()))
    # Share of the travel that no joint runs on after its command has stopped.
    return (beyond and moving) or passed >= 0.5 * float(np.ptp(c.other))


def _passes(c: _AnglePair, at: int, length: int, end: int) -> bool:
    """Whether the joint keeps its speed where ``own``, which moved with it, stops changing.

    ``end`` is 1 there and -1 where ``own`` goes on.
    """
    width = min(_BESIDE, length)
    before, after = slice(max(at - width, 0), at), slice(at, at + width)
    beside = before if end == 1 else slice(at + 1, at + 1 + width)
    own, other = (x[beside.start : beside.stop + 1] for x in (c.own, c.other))
    if own.size < 2:
        return False
    speeds = float(c.speed[before].mean()), float(c.speed[after].mean())
    return _alike(float(own[-1] - own[0]), float(other[-1] - other[0])) and _alike(*speeds)


def _alike(x: float, y: float) -> bool:
    return x * y > 0.0 and _ALIKE <= x / y <= 1.0 / _ALIKE
