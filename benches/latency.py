"""Latency of single samples in a paced loop, beside a loop that does nothing."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CallTimes", "histogram", "paced"]

#: Cycles before the first that counts.
_WARM_UP = 100


class CallTimes(NamedTuple):
    """Nanoseconds of the calls of one loop."""

    name: str
    rate: float
    nanoseconds: NDArray[np.int64]

    def quantiles(self) -> dict[str, float]:
        """p50, p99, p99.9 and the greatest."""
        parts = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
        return {name: float(np.quantile(self.nanoseconds, q)) for name, q in parts.items()}


def paced(name: str, function: Callable[[float], object], rate: float, calls: int) -> CallTimes:
    """Call ``function`` every ``1 / rate`` seconds and time each call.

    The loop waits by looking at the clock, as a real-time loop on a core of its own does;
    what the scheduler takes away shows in the greatest values.
    """
    clock = time.perf_counter_ns
    period = round(1e9 / rate)
    taken = np.empty(calls + _WARM_UP, dtype=np.int64)
    angles = np.linspace(0.0, 100.0, taken.size).tolist()
    due = clock() + period
    for i, angle in enumerate(angles):
        while clock() < due:
            pass
        start = clock()
        function(angle)
        taken[i] = clock() - start
        due += period
    return CallTimes(name, rate, taken[_WARM_UP:])


def histogram(latency: CallTimes, width: int = 50) -> str:
    """Counts over octaves of nanoseconds as lines of text."""
    octave = np.floor(np.log2(np.maximum(latency.nanoseconds, 1))).astype(int)
    counts = np.bincount(octave)
    lines = []
    for power in range(int(octave.min()), counts.size):
        # Marks on a logarithmic scale: one call in a million is still seen.
        marks = 0 if counts[power] == 0 else 1 + int(np.log10(counts[power]) / 6 * width)
        lines.append(f"{2**power:>10} ns {counts[power]:>9} {'#' * marks}")
    return "\n".join(lines)
