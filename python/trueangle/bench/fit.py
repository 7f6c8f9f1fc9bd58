"""Least-squares fits: ours against `trueangle.bench.fitpeers`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..fitting.fit import fit
from ..runs.run import CalibrationRun
from .fitpeers import peers
from .interleaved import Timing, interleave

__all__ = ["Case", "FitRow", "measure", "quick", "readings"]


class Case(NamedTuple):
    """One problem: readings over an arc of the circle, orders 1 to the highest.

    With ``counts`` the angles are whole numbers of them to a turn.
    """

    samples: int
    highest: int
    arc_deg: float = 360.0
    counts: int | None = None

    @property
    def period(self) -> float:
        """One turn in the unit in which our fit gets the angles."""
        return 2.0 * np.pi if self.counts is None else float(self.counts)


class FitRow(NamedTuple):
    """What one way of fitting took."""

    case: Case
    name: str
    timing: Timing
    deviation: float
    """Largest difference of a coefficient from ours, relative to the largest."""


def readings(case: Case) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles in radians at random over the arc, and errors with noise; seed 0."""
    rng = np.random.default_rng(0)
    theta = rng.uniform(0.0, np.radians(case.arc_deg), case.samples)
    if case.counts is not None:
        theta = np.rint(theta * (case.counts / (2.0 * np.pi))) * (2.0 * np.pi / case.counts)
    error = 1e-3 * np.cos(theta) + 1e-4 * np.sin(3 * theta) + 1e-5 * rng.normal(size=theta.size)
    return theta, error


def _ours(
    run: CalibrationRun, highest: int, threads: int | None = None, method: str | None = None
) -> NDArray[np.float64]:
    """The core alone: coefficients in radians."""
    orders = list(range(1, highest + 1))
    found = _core.fit(
        [(run.reference, run.indicated, None)],
        run.period,
        [1.0],
        [orders],
        method=method,
        threads=threads,
    )
    return _coefficients(found, run.period)


def _whole(run: CalibrationRun, highest: int) -> NDArray[np.float64]:
    """All that `trueangle.fit` does by default: checks, outliers, travel."""
    found = fit(run, orders=range(1, highest + 1))
    return _coefficients(found.fitted.solution, run.period)


def _coefficients(solution: _core.Solution, period: float) -> NDArray[np.float64]:
    """``[constant, A, B, ...]`` in radians."""
    pairs = np.column_stack([solution.cosine[0], solution.sine[0]]).ravel()
    return np.concatenate([[solution.constant], pairs]) * (2.0 * np.pi / period)


def measure(
    case: Case,
    rounds: int = 5,
    only: Iterable[str] | None = None,
    threads: Iterable[int] = (1, 2),
    methods: Iterable[str] = (),
) -> list[FitRow]:
    """Time our fit, by numbers of threads and forced methods, and those of the peers."""
    theta, error = readings(case)
    unit = case.period / (2.0 * np.pi)
    place = theta * unit if case.counts is None else np.rint(theta * unit)
    run = CalibrationRun(place, place + error * unit, period=case.period)
    ways: dict[str, Callable[[], NDArray[np.float64]]] = {
        f"trueangle, {n} thread{'s' * (n > 1)}": partial(_ours, run, case.highest, threads=n)
        for n in threads
    }
    for method in methods:
        name = f"trueangle, 1 thread, {method}"
        ways[name] = partial(_ours, run, case.highest, threads=1, method=method)
    ways["trueangle.fit, all it does"] = partial(_whole, run, case.highest)
    for name, peer in peers()[0].items():
        if only is None or name in only:
            ways[name] = partial(peer, theta, error, case.highest)
    timings = interleave(ways, rounds)
    ours = next(iter(ways.values()))()
    scale = np.abs(ours).max()
    return [
        FitRow(case, name, timing, float(np.abs(ways[name]() - ours).max() / scale))
        for name, timing in timings.items()
    ]


def quick(samples: int, rounds: int) -> list[FitRow]:
    """A polygon's problem and one of ``samples`` readings."""
    small = measure(Case(37, 5), 20 * rounds, threads=(1,))
    return small + measure(Case(samples, 17), rounds)
