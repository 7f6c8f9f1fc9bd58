"""How the time of a fleet grows with its units, and that of a watched joint with its windows."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..estimation.moments import Moments
from ..fitting.fit import fit
from ..fleets.fleet import fleet
from ..model.model import HarmonicModel
from ..monitoring.monitor import Monitor
from ..runs.run import CalibrationRun
from .evaluation import harmonics
from .interleaved import Timing, interleave
from .scaling import Measured

__all__ = ["READINGS_EACH", "WINDOWS", "by_units", "by_windows"]

Array = NDArray[np.float64]

#: Readings and orders of each unit.
READINGS_EACH: Final = 180
ORDERS: Final = 4

#: Readings of a window, and orders that are watched.
WINDOWS: Final = (500, 2000, 20_000)
WATCHED: Final = 8


def by_units(most: int) -> list[Measured]:
    """A fleet of 10 units and more, a decade apart, and a fit of each of them: once.

    The units are made one after the other and only their sums are kept.
    """
    found = []
    units = 10
    while units <= most:
        for work, way in (
            ("fleet", partial(fleet, _units(units), orders=range(1, ORDERS + 1))),
            ("fit of each", partial(_each, units)),
        ):
            start = time.perf_counter()
            way()
            taken = time.perf_counter() - start
            found.append(
                Measured(work, READINGS_EACH * units, ORDERS, 1, Timing(taken, taken, taken))
            )
        units *= 10
    return found


def by_windows(readings: int, rounds: int = 5) -> list[Measured]:
    """Watching so many readings in windows of `WINDOWS`, and their sums (`Moments`) alone."""
    model = harmonics(range(1, WATCHED + 1))
    rng = np.random.default_rng(0)
    noise = 1e-5 * rng.normal(size=readings)
    found = []
    for window in WINDOWS:
        angle: Array = np.linspace(0.0, 2.0 * math.pi * readings / window, readings, endpoint=False)
        error = np.asarray(model.error(angle)) + noise
        timings = interleave(
            {
                "moments": partial(_summed, angle, error),
                f"watch, {window}": partial(_watched, model, angle, error),
            },
            rounds,
        )
        found += [Measured(work, readings, WATCHED, 1, taken) for work, taken in timings.items()]
    return found


def _summed(angle: Array, error: Array) -> None:
    Moments(range(1, WATCHED + 1)).update(angle, error, threads=1)


def _watched(model: HarmonicModel, angle: Array, error: Array) -> None:
    Monitor(model).update(angle, error)


def _units(count: int) -> Iterator[CalibrationRun]:
    """Units of one pattern and a spread, one after the other; seed 0."""
    rng = np.random.default_rng(0)
    angle: Array = np.linspace(0.0, 2.0 * math.pi, READINGS_EACH, endpoint=False)
    orders = np.arange(1, ORDERS + 1)[:, None]
    columns = np.concatenate([np.cos(orders * angle), np.sin(orders * angle)])
    for unit in range(count):
        own = 1e-4 * rng.normal(1.0, 0.3, len(columns))
        error = own @ columns + 1e-5 * rng.normal(size=angle.size)
        yield CalibrationRun(angle, angle + error, 2.0 * np.pi, unit=str(unit))


def _each(count: int) -> None:
    for run in _units(count):
        _ = fit(run, orders=range(1, ORDERS + 1)).model  # what a fit is asked for last is made then
