"""What happened once in a run: a step that settles, and a segment whose readings are late."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...estimation.factor import orthonormal_basis
from ...joint.signals import Signals
from ...support.arrays import Array
from .group import GRID, Group

#: Lengths of what rises before an event and settles after it, in shares of the longest run.
SETTLES: Final = (0.003, 0.01, 0.03, 0.1, 0.3)

#: Ends of a segment that are tried at once in a run.
ENDS: Final = 120


def step_events(signals: Signals, events: Sequence[tuple[int, int]]) -> Iterator[Group]:
    """What rises before an event of one run and settles after it, and the step that it leaves.

    That lasts to the end of the run, or through those after it.
    """
    longest = int(signals.row.max(initial=0)) + 1
    at = np.linspace(-0.3, 0.3, GRID) * longest
    lengths = np.array(SETTLES) * longest

    def both(x: NDArray[Any], scale: float = 1.0) -> Array:
        decays = np.exp(-np.abs(x)[:, None] / lengths)
        before, after = x[:, None] < 0.0, x[:, None] > 0.0
        return np.hstack([decays * before, decays * after, after, after]) / scale

    for run, row in events:
        inside, later = signals.run == run, signals.run > run
        away = signals.row - (row - 0.5)
        columns = both(away) * inside[:, None]
        columns[:, -1] += later
        scale = float(np.sqrt(np.sum(np.var(columns, axis=0))))
        if scale > 0.0:
            own, count = partial(both, scale=scale), len(signals)
            yield Group("run_time", columns / scale, (), at, own, "reading", count, (run, row))


def late_readings(signals: Signals, error: Array) -> Iterator[Group]:
    """The segment of a run in which the speed explains most as a group; none without a speed.

    ::

        v 1(a <= t < b)

    jointly with a zero and a delay of the whole run.
    """
    v = signals.velocity
    if v is None or not np.ptp(v) > 0.0:
        return
    found = [(*_segment(v[a:b], error[a:b]), a) for a, b in signals.run_bounds() if b - a > GRID]
    gain, first, last, start = max(found, default=(0.0, 0, 0, 0))
    column = np.zeros((v.size, 1))
    column[start + first : start + last, 0] = v[start + first : start + last]
    scale = float(np.std(column))
    if gain > 0.0 and scale > 0.0:
        at = np.linspace(0.0, float(last - first), GRID)
        event = int(signals.run[start]), int(signals.row[start + first])
        count = float(sum(n * n for n in np.bincount(signals.run)))
        yield Group("run_time", column / scale, (), at, None, "reading", count, event)


def _segment(v: Array, error: Array) -> tuple[float, int, int]:
    """Sum of squares that the best segment of a run explains, its first reading and its end."""
    known = np.column_stack([np.ones(v.size), v])
    basis = orthonormal_basis(known)
    left = error - basis @ (basis.T @ error)
    terms = np.column_stack([v * left, v * v, basis * v[:, None]])
    sums = np.vstack([np.zeros(terms.shape[1]), np.cumsum(terms, axis=0)])

    def best(firsts: NDArray[np.int64], lasts: NDArray[np.int64]) -> tuple[float, int, int]:
        inside = sums[lasts][None, :, :] - sums[firsts][:, None, :]
        power = inside[..., 1] - np.sum(inside[..., 2:] ** 2, axis=-1)
        enough = power > 1e-6 * sums[-1, 1]
        gain = np.where(enough, inside[..., 0] ** 2 / np.where(enough, power, 1.0), 0.0)
        gain[firsts[:, None] >= lasts[None, :]] = 0.0
        i, j = np.unravel_index(np.argmax(gain), gain.shape)
        return float(gain[i, j]), int(firsts[i]), int(lasts[j])

    ends = np.unique(np.linspace(0, v.size, ENDS).astype(np.int64))
    _, first, last = best(ends, ends)
    step = -(-v.size // (ENDS - 1))
    near = [np.arange(max(k - step, 0), min(k + step, v.size) + 1) for k in (first, last)]
    return best(near[0], near[1])
