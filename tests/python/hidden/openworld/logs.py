"""Readings as they are written down: bursts of glitches, and tables of equal steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trueangle import CalibrationRun

from ..measurement import ARCSEC
from .timebound import correlated

#: Readings of a burst and its size in standard deviations of the noise.
BURSTS = [(length, size) for length in (2, 3, 4) for size in (10.0, 30.0, 300.0)]

#: Positions of tables, runs of each.
TABLES = ((36, 1), (80, 2), (144, 1), (250, 3), (400, 1))

#: Share of the readings that stand in bursts.
SHARE = 0.006

#: Lines of tables: order and arcsec; noise of their readings.
LINES, TABLE_SIGMA = ((1, 75.0), (2, 30.0), (3, 14.0)), 2.5


def with_bursts(
    runs: Sequence[CalibrationRun], length: int, size: float, rng: np.random.Generator
) -> tuple[list[CalibrationRun], set[tuple[str, int]]]:
    """Runs with bursts of ``size`` arcsec, all of one sign or not, and the rows in them."""
    found, rows = [], set()
    for run in runs:
        indicated = run.indicated.copy()
        for start in rng.integers(6, len(run) - 10, rng.poisson(SHARE * len(run) / length)):
            signs = rng.choice([-1.0, 1.0], 1 if rng.integers(2) else length)
            wild = signs * rng.uniform(0.8, 1.5, length) * size
            indicated[start : start + length] += wild * ARCSEC
            rows |= {(str(run.label), int(start + k)) for k in range(length)}
        columns = {
            name: getattr(run, name)
            for name in ("time", "temperature", "torque", "mount", "label", "velocity")
        }
        found.append(CalibrationRun(run.reference, indicated, period=360.0, **columns))
    return found, rows


def table(
    positions: int,
    runs: int,
    rng: np.random.Generator,
    lines: Sequence[tuple[int, float]] = LINES,
    visited: str = "forward",
    shared: float = 0.0,
) -> list[CalibrationRun]:
    """Tables of the true angle at indicated angles of equal steps.

    Positions are ``visited`` forward, there and "back", or at "random"; neighbours share a part
    of their noise.
    """
    grid = np.arange(positions) * 360.0 / positions
    phases = rng.uniform(0.0, 6.28, len(lines))
    if visited == "back":
        grid = np.concatenate([grid, grid[::-1]])
    found = []
    for j in range(runs):
        if visited == "random":
            grid = rng.permutation(grid)
        angle = grid.copy()
        for _ in range(9):
            error = sum(
                (
                    size * np.sin(np.radians(order * angle) + phase)
                    for (order, size), phase in zip(lines, phases, strict=True)
                ),
                np.zeros(grid.size),
            )
            angle = grid - error * ARCSEC
        angle = angle + TABLE_SIGMA * correlated(grid.size, shared, rng) * ARCSEC
        found.append(CalibrationRun(angle, grid, period=360.0, label=f"table{j}"))
    return found
