"""How time grows with readings, orders, threads and workers; with units of a fleet and windows."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from harness.evaluation import evaluated_model
from harness.fit import Case, fit_readings
from harness.interleaved import Timing, interleave
from trueangle.errors import MissingExtraError
from trueangle.estimation.moments import Moments
from trueangle.fitting.fit import fit
from trueangle.fleets.fleet import fleet
from trueangle.model.model import HarmonicModel
from trueangle.model.monitor import Monitor
from trueangle.runs.run import CalibrationRun
from trueangle.support.arrays import Array

_Ways: TypeAlias = dict[tuple[str, int], Callable[[], object]]

#: Orders where readings are counted, and readings where orders are.
ORDERS: Final = 17
READINGS: Final = 1_000_000

#: Numbers of orders looked at.
_STEPS: Final = (1, 4, 16, 64, 256, 1024)

#: Readings and orders of each unit of a fleet.
READINGS_EACH: Final = 180
ORDERS_EACH: Final = 4

#: Readings of a window, and orders that are watched.
WINDOWS: Final = (500, 2000, 20_000)
WATCHED: Final = 8

#: Readings from which on three rounds are enough.
_MANY: Final = 30_000_000


class MeasuredWork(NamedTuple):
    """What a piece of work took."""

    work: str
    readings: int
    orders: int
    threads: int
    timing: Timing


class WorkCost(NamedTuple):
    """The model of cost ``t(n) = t₀ + n t₁`` of one work with so many threads, in seconds.

    ``spread`` is the largest relative departure of what was measured from it.
    """

    work: str
    threads: int
    call: float
    reading: float
    spread: float

    def seconds(self, readings: float) -> float:
        """What so many readings take."""
        return self.call + self.reading * readings


def scaling_by_readings(
    largest: int, rounds: int = 5, threads: Sequence[int] = (1, 2)
) -> list[MeasuredWork]:
    """Corrections and fits of 10^3 readings and more, a decade apart, `ORDERS` orders."""
    theta, error = fit_readings(Case(largest, ORDERS))
    indicated, out = theta + error, np.empty_like(theta)
    model = evaluated_model(range(1, ORDERS + 1))
    found = []
    for size in (10**k for k in range(3, round(math.log10(largest)) + 1)):
        run = CalibrationRun(theta[:size], indicated[:size], period=2.0 * math.pi)
        ways: _Ways = {}
        for n in threads:
            ways["correct", n] = partial(model.correct, indicated[:size], out=out[:size], threads=n)
            ways["fit", n] = partial(fit, run, orders=range(1, ORDERS + 1), threads=n)
        found += _measured(ways, size, ORDERS, 3 if size >= _MANY else rounds)
    return found


def scaling_by_orders(
    rounds: int = 5, most: int = 1024, size: int = READINGS
) -> list[MeasuredWork]:
    """Corrections and fits of `READINGS` readings with ever more orders, one thread."""
    theta, error = fit_readings(Case(size, 1))
    indicated, out = theta + error, np.empty_like(theta)
    run = CalibrationRun(theta, indicated, period=2.0 * math.pi)
    found = []
    for orders in (k for k in _STEPS if k <= most):
        wanted = range(1, orders + 1)
        ways: _Ways = {
            ("correct", 1): partial(evaluated_model(wanted).correct, indicated, out=out, threads=1),
            ("fit", 1): partial(fit, run, orders=wanted, threads=1),
        }
        found += _measured(ways, size, orders, rounds)
    return found


def scaling_by_workers(workers: Sequence[int], size: int, files: int = 8) -> list[MeasuredWork]:
    """Fits of logs (Parquet) shared by the workers of a Dask cluster on this machine.

    Raises
    ------
    MissingExtraError
        Dask's scheduler or pyarrow is not installed.
    """
    try:
        import distributed
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError(
            "workers need Dask and Parquet: pip install 'trueangle[logs]'"
        ) from None
    from trueangle.logs.fitting import fit_logs

    found = []
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"{k}.parquet") for k in range(files)]
        theta, error = fit_readings(Case(size // files, ORDERS))
        columns = {"reference_rad": theta, "indicated_rad": theta + error}
        for path in paths:
            pq.write_table(pa.table(columns), path)
        for count in workers:
            with distributed.LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True, dashboard_address=":0"
            ) as cluster:
                work = partial(
                    fit_logs, paths, range(1, ORDERS + 1),
                    scheduler=cluster.scheduler_address, progress="none",
                )  # fmt: skip
                work()  # imports of the workers
                start = time.perf_counter()
                work()
                taken = time.perf_counter() - start
            timing = Timing(taken, taken, taken)
            found.append(MeasuredWork("fit of logs", files * theta.size, ORDERS, count, timing))
    return found


def scaling_by_units(most: int) -> list[MeasuredWork]:
    """A fleet of 10 units and more, a decade apart, and a fit of each of them: once.

    The units are made one after the other and only their sums are kept.
    """
    found = []
    units = 10
    while units <= most:
        for work, way in (
            ("fleet", partial(fleet, _units(units), orders=range(1, ORDERS_EACH + 1))),
            ("fit of each", partial(_each, units)),
        ):
            start = time.perf_counter()
            way()
            taken = time.perf_counter() - start
            found.append(
                MeasuredWork(
                    work, READINGS_EACH * units, ORDERS_EACH, 1, Timing(taken, taken, taken)
                )
            )
        units *= 10
    return found


def scaling_by_windows(readings: int, rounds: int = 5) -> list[MeasuredWork]:
    """Watching so many readings in windows of `WINDOWS`, and their sums (`Moments`) alone."""
    model = evaluated_model(range(1, WATCHED + 1))
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
        found += [
            MeasuredWork(work, readings, WATCHED, 1, taken) for work, taken in timings.items()
        ]
    return found


def work_costs(measured: Sequence[MeasuredWork]) -> list[WorkCost]:
    """The model of cost of each work and number of threads, by relative least squares."""
    found = []
    for work, threads in dict.fromkeys((m.work, m.threads) for m in measured):
        own = [m for m in measured if (m.work, m.threads) == (work, threads)]
        size = np.array([m.readings for m in own], dtype=np.float64)
        taken = np.array([m.timing.median for m in own])
        rows = np.stack([1.0 / taken, size / taken], axis=1)
        call, reading = np.linalg.lstsq(rows, np.ones(len(own)), rcond=None)[0].tolist()
        if call < 0.0:  # nothing but readings
            call, reading = 0.0, float(rows[:, 1].sum() / (rows[:, 1] @ rows[:, 1]))
        spread = float(np.abs((call + reading * size) / taken - 1.0).max())
        found.append(WorkCost(work, threads, call, reading, spread))
    return found


def _measured(ways: _Ways, size: int, orders: int, rounds: int) -> list[MeasuredWork]:
    timings = interleave({f"{work} {n}": way for (work, n), way in ways.items()}, rounds)
    return [MeasuredWork(work, size, orders, n, timings[f"{work} {n}"]) for work, n in ways]


def _summed(angle: Array, error: Array) -> None:
    Moments(range(1, WATCHED + 1)).update(angle, error, threads=1)


def _watched(model: HarmonicModel, angle: Array, error: Array) -> None:
    Monitor(model).update(angle, error)


def _units(count: int) -> Iterator[CalibrationRun]:
    """Units of one pattern and a spread, one after the other; seed 0."""
    rng = np.random.default_rng(0)
    angle: Array = np.linspace(0.0, 2.0 * math.pi, READINGS_EACH, endpoint=False)
    orders = np.arange(1, ORDERS_EACH + 1)[:, None]
    columns = np.concatenate([np.cos(orders * angle), np.sin(orders * angle)])
    for unit in range(count):
        own = 1e-4 * rng.normal(1.0, 0.3, len(columns))
        error = own @ columns + 1e-5 * rng.normal(size=angle.size)
        yield CalibrationRun(angle, angle + error, 2.0 * np.pi, unit=str(unit))


def _each(count: int) -> None:
    for run in _units(count):
        _ = fit(
            run, orders=range(1, ORDERS_EACH + 1)
        ).model  # what a fit is asked for last is made then
