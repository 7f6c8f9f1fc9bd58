"""Sweeps of a joint on a bench as they are most often measured: few runs, no column but time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from trueangle import CalibrationRun

__all__ = ["ROUTES", "measured", "route", "with_rests"]

Array = NDArray[np.float64]
Motion = Callable[[Array], Array]

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


def with_rests(rng: np.random.Generator, speed: float, count: int) -> tuple[Array, Motion]:
    """Times of one sweep there and back with rests, and the angle (deg) at any time.

    Speed is gained evenly over some tenths of a second.
    """
    travel, gaining = float(rng.uniform(250.0, 350.0)), float(rng.uniform(0.1, 0.4))
    rests, moving = rng.uniform(1.0, 2.0, 3), travel / speed
    ends = np.cumsum([0.0, rests[0], moving, rests[1], moving, rests[2]])
    places = rng.uniform(0.0, 360.0) + np.array([0.0, 0.0, travel, travel, 0.0, 0.0])
    around = np.linspace(-0.5 * gaining, 0.5 * gaining, 41)

    def angle(time: Array) -> Array:
        return np.asarray(np.interp(time[:, None] + around, ends, places).mean(axis=1))

    return np.linspace(0.0, ends[-1], count), angle


def measured(theta: Array, time: Array, error: Array, label: str = "") -> CalibrationRun:
    """A run with an error in arcsec at true angles in degrees."""
    indicated = np.radians(theta + error / 3600.0)
    return CalibrationRun(reference=np.radians(theta), indicated=indicated, time=time, label=label)
