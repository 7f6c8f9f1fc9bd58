"""Timing of several ways to do one thing, side by side."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Timing(NamedTuple):
    """Seconds of one call."""

    median: float
    least: float
    most: float


def interleave(ways: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, Timing]:
    """Time each way once per round, after one call each that does not count.

    A machine that changes its speed changes it for all of them, so ratios of medians hold
    where the times themselves do not.
    """
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for way in ways.values():
        way()
    for _ in range(rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            seconds[name].append(time.perf_counter() - start)
    return {
        name: Timing(statistics.median(taken), min(taken), max(taken))
        for name, taken in seconds.items()
    }
