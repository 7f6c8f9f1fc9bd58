"""What happened once in a run: a step that settles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...joint.signals import Signals
from ...support.arrays import Array
from .group import GRID, Group

#: Lengths of what rises before an event and settles after it, in shares of the longest run.
SETTLES: Final = (0.003, 0.01, 0.03, 0.1, 0.3)


def step_events(signals: Signals, events: Sequence[tuple[int, int]]) -> Iterator[Group]:
    """What rises before an event of one run and settles after it, with the step that it leaves.

    That lasts to the end of the run, or through those after it; the latter alone is a sharp step.
    """
    longest = int(signals.row.max(initial=0)) + 1
    at = np.linspace(-0.3, 0.3, GRID) * longest
    lengths = np.array(SETTLES) * longest

    def both(x: NDArray[Any], scale: float, first: int) -> Array:
        decays = np.exp(-np.abs(x)[:, None] / lengths)
        before, after = x[:, None] < 0.0, x[:, None] > 0.0
        return np.hstack([decays * before, decays * after, after, after])[:, first:] / scale

    for run, row in events:
        inside, later = signals.run == run, signals.run > run
        away = signals.row - (row - 0.5)
        for first in (0, 2 * lengths.size + 1):
            columns = both(away, 1.0, first) * inside[:, None]
            columns[:, -1] += later
            scale = float(np.sqrt(np.sum(np.var(columns, axis=0))))
            if scale > 0.0:
                own, count = partial(both, scale=scale, first=first), len(signals)
                event = signals.labels[run], row
                yield Group("run_time", columns / scale, (), at, own, "reading", count, event)
