"""Random motions with their signals, in blocks that go on where the last one ended."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

__all__ = ["ROW", "UNIT", "trajectories", "trajectory"]

#: Degrees of the last place of an angle, 2^-32 turns.
UNIT = 360.0 / 2.0**32
#: A reading and its signals, as float32 holds them; `machines/walk.c` reads such rows.
ROW = np.dtype([
    ("place", "<i8"), ("velocity", "<f4"), ("temperature", "<f4"), ("torque", "<f4"),
    ("current", "<f4"), ("direction", "<i8"),
])  # fmt: skip
#: Rows of a block: memory stays small however long the motion.
BLOCK = 100_000
#: Readings in which the joint keeps its speed, and seconds between them.
LEG, STEP = 50, 0.002


def trajectories(seed: int, count: int, block: int = BLOCK) -> Iterator[np.ndarray]:
    """A joint that moves, turns back, rests and trembles: ``count`` rows in blocks."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 360.0)
    for first in range(0, count, block):
        size = min(block, count - first)
        legs = size // LEG + 1
        velocity = np.repeat(rng.normal(0.0, 60.0, legs) * (rng.random(legs) < 0.8), LEG)[:size]
        velocity += rng.normal(0.0, 0.5, size) * (rng.random(size) < 0.2)
        rows = np.zeros(size, ROW)
        way = angle + np.cumsum(velocity * STEP)
        angle = way[-1]
        rows["place"] = np.floor(way / UNIT)
        rows["velocity"] = velocity / 360.0
        rows["temperature"] = 20.0 + 5.0 * np.sin(np.arange(first, first + size) / 3000.0)
        rows["torque"] = rng.normal(0.0, 5.0, size)
        rows["current"] = rng.normal(0.0, 1.0, size)
        rows["direction"] = np.sign(velocity)
        yield rows


def trajectory(seed: int, count: int) -> np.ndarray:
    """The same as one block."""
    return next(trajectories(seed, count, count))
