"""Segments of readings that follow each other in a run, and the level about them."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

#: Readings in a row up to which a glitch is a glitch: what lasts longer is an error of the mean.
MOST_IN_ROW = 4

#: Readings to either side that make the level about one: more than half are none of a glitch.
REACH = MOST_IN_ROW + 1


def flagged_segments(
    flags: NDArray[np.bool_], bounds: list[tuple[int, int]]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and one-past-last reading of every segment of true flags; none goes over two runs.

    Examples
    --------
    >>> flags = np.array([True, True, False, True, True])
    >>> starts, stops = flagged_segments(flags, [(0, 4), (4, 5)])
    >>> starts.tolist(), stops.tolist()
    ([0, 3, 4], [2, 4, 5])
    """
    edges = np.zeros(flags.size + 1, dtype=bool)
    edges[[start for start, _ in bounds]] = True
    before = np.concatenate([[False], flags])
    after = np.concatenate([flags, [False]])
    return np.flatnonzero(after & (~before | edges)), np.flatnonzero(before & (~after | edges))


def short_segments(flags: NDArray[np.bool_], bounds: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """The flags that are in segments of at most `MOST_IN_ROW`.

    Examples
    --------
    >>> short_segments(np.array([True, False, *[True] * 5]), [(0, 7)]).astype(int).tolist()
    [1, 0, 0, 0, 0, 0, 0]
    """
    return _core.short_stretches(flags, bounds)


def within_segments(
    starts: NDArray[np.int64], stops: NDArray[np.int64], n: int
) -> NDArray[np.bool_]:
    """Which of n readings are in one of some segments.

    Examples
    --------
    >>> within_segments(np.array([1]), np.array([3]), 5).astype(int).tolist()
    [0, 1, 1, 0, 0]
    """
    change = np.zeros(n + 1, dtype=np.int64)
    change[starts] += 1
    np.subtract.at(change, stops, 1)
    return np.asarray(np.cumsum(change[:-1]) > 0)


def less_local_level(values: Array, bounds: list[tuple[int, int]]) -> Array:
    """Readings less the median of those about each: a glitch remains, slow changes do not.

    About 5 ms for 10 000 readings.
    """
    out = np.empty_like(values)
    for start, stop in bounds:
        part = values[start:stop]
        if part.size <= REACH:
            out[start:stop] = part - np.median(part)
            continue
        windows = sliding_window_view(np.pad(part, REACH, mode="reflect"), 2 * REACH + 1)
        out[start:stop] = part - np.median(windows, axis=1)
    return out
