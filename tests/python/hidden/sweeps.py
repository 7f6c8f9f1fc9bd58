"""Sweeps of a joint on a bench as they are most often measured: few runs, no column but time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trueangle import CalibrationRun

__all__ = ["ROUTES", "measured", "route"]

Array = NDArray[np.float64]

#: Ways of a sweep: free or equal positions of a turn one way, a turn there and back, an arc.
ROUTES = ("turn", "equal steps", "there and back", "arc there and back")

#: Readings of a turn, and degrees per second.
READINGS, SPEED = 360, 20.0


def route(kind: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """True angle in degrees and time in seconds at the readings of one sweep."""
    if kind == "equal steps":
        theta = np.arange(READINGS) * (360.0 / READINGS)
    else:
        travel = 200.0 if kind.startswith("arc") else 360.0
        theta = 17.0 + np.sort(rng.uniform(0.0, travel, READINGS))
        theta[[0, -1]] = 17.0, 17.0 + travel
    if kind.endswith("there and back"):
        theta = np.concatenate([theta, theta[::-1]])
    time = np.concatenate([[0.0], np.cumsum(np.maximum(np.abs(np.diff(theta)), 1e-3))]) / SPEED
    return theta, time


def measured(theta: Array, time: Array, error: Array, label: str = "") -> CalibrationRun:
    """A run with an error in arcsec at true angles in degrees."""
    indicated = np.radians(theta + error / 3600.0)
    return CalibrationRun(reference=np.radians(theta), indicated=indicated, time=time, label=label)
