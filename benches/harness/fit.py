"""Least-squares fits: ours, and what users fit harmonics with today."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harness.interleaved import Timing, interleave
from trueangle import _core
from trueangle.fitting.fit import fit
from trueangle.runs.run import CalibrationRun

_Array = NDArray[np.float64]
#: A fit of angles, errors and the highest order.
_Fit = Callable[[_Array, _Array, int], _Array]


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


def fit_readings(case: Case) -> tuple[_Array, _Array]:
    """Angles in radians at random over the arc, and errors with noise; seed 0."""
    rng = np.random.default_rng(0)
    theta = rng.uniform(0.0, np.radians(case.arc_deg), case.samples)
    if case.counts is not None:
        theta = np.rint(theta * (case.counts / (2.0 * np.pi))) * (2.0 * np.pi / case.counts)
    error = 1e-3 * np.cos(theta) + 1e-4 * np.sin(3 * theta) + 1e-5 * rng.normal(size=theta.size)
    return theta, error


def _ours(
    run: CalibrationRun, highest: int, threads: int | None = None, method: str | None = None
) -> _Array:
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


def _whole(run: CalibrationRun, highest: int) -> _Array:
    """All that `trueangle.fit` does by default: checks, outliers, travel."""
    found = fit(run, orders=range(1, highest + 1))
    return _coefficients(found.fitted.solution, run.period)


def _coefficients(solution: _core.Solution, period: float) -> _Array:
    """``[constant, A, B, ...]`` in radians."""
    pairs = np.column_stack([solution.cosine[0], solution.sine[0]]).ravel()
    return np.concatenate([[solution.constant], pairs]) * (2.0 * np.pi / period)


def measure_fits(
    case: Case,
    rounds: int = 5,
    only: Iterable[str] | None = None,
    threads: Iterable[int] = (1, 2),
    methods: Iterable[str] = (),
) -> list[FitRow]:
    """Time our fit, by numbers of threads and forced methods, and those of the peers."""
    theta, error = fit_readings(case)
    unit = case.period / (2.0 * np.pi)
    place = theta * unit if case.counts is None else np.rint(theta * unit)
    run = CalibrationRun(place, place + error * unit, period=case.period)
    ways: dict[str, Callable[[], _Array]] = {
        f"trueangle, {n} thread{'s' * (n > 1)}": partial(_ours, run, case.highest, threads=n)
        for n in threads
    }
    for method in methods:
        name = f"trueangle, 1 thread, {method}"
        ways[name] = partial(_ours, run, case.highest, threads=1, method=method)
    ways["trueangle.fit, all it does"] = partial(_whole, run, case.highest)
    for name, peer in fit_peers()[0].items():
        if only is None or name in only:
            ways[name] = partial(peer, theta, error, case.highest)
    timings = interleave(ways, rounds)
    ours = next(iter(ways.values()))()
    scale = np.abs(ours).max()
    return [
        FitRow(case, name, timing, float(np.abs(ways[name]() - ours).max() / scale))
        for name, timing in timings.items()
    ]


def quick_fits(samples: int, rounds: int) -> list[FitRow]:
    """A polygon's problem and one of ``samples`` readings."""
    small = measure_fits(Case(37, 5), 20 * rounds, threads=(1,))
    return small + measure_fits(Case(samples, 17), rounds)


def fit_columns(theta: _Array, highest: int) -> _Array:
    """Columns ``1, cos, sin, cos 2x, sin 2x ...``."""
    columns = np.empty((theta.size, 2 * highest + 1))
    columns[:, 0] = 1.0
    for k in range(1, highest + 1):
        np.cos(k * theta, out=columns[:, 2 * k - 1])
        np.sin(k * theta, out=columns[:, 2 * k])
    return columns


def _lstsq(theta: _Array, error: _Array, highest: int) -> _Array:
    return np.asarray(np.linalg.lstsq(fit_columns(theta, highest), error)[0], dtype=np.float64)


def _normal_equations(theta: _Array, error: _Array, highest: int) -> _Array:
    rows = fit_columns(theta, highest)
    return np.asarray(np.linalg.solve(rows.T @ rows, rows.T @ error), dtype=np.float64)


def _gelsy(theta: _Array, error: _Array, highest: int) -> _Array:
    linalg = importlib.import_module("scipy.linalg")
    found = linalg.lstsq(fit_columns(theta, highest), error, lapack_driver="gelsy")[0]
    return np.asarray(found)


def _astropy(theta: _Array, error: _Array, highest: int) -> _Array:
    timeseries = importlib.import_module("astropy.timeseries")
    # A period of 2 pi is a frequency of 1 / (2 pi).
    periodogram = timeseries.LombScargle(theta, error, nterms=highest, center_data=False)
    found = np.array(periodogram.model_parameters(0.5 / np.pi))
    found[1::2], found[2::2] = found[2::2].copy(), found[1::2].copy()  # sines come first
    return found


def _statsmodels(theta: _Array, error: _Array, highest: int) -> _Array:
    api = importlib.import_module("statsmodels.api")
    return np.asarray(api.OLS(error, fit_columns(theta, highest)).fit(method="qr").params)


def _finufft(theta: _Array, error: _Array, highest: int) -> _Array:
    """Sums by the non-uniform transform, then the Toeplitz system of their harmonics."""
    finufft = importlib.import_module("finufft")
    linalg = importlib.import_module("scipy.linalg")
    ones = np.ones(theta.size, dtype=complex)
    weight = finufft.nufft1d1(theta, ones, 4 * highest + 1, eps=1e-14, isign=1)[2 * highest :]
    right = finufft.nufft1d1(theta, error + 0j, 2 * highest + 1, eps=1e-14, isign=-1)
    spectrum = linalg.solve_toeplitz(np.conj(weight), right)[highest:]
    found = np.empty(2 * highest + 1)
    found[0], found[1::2], found[2::2] = (
        spectrum[0].real,
        2 * spectrum[1:].real,
        -2 * spectrum[1:].imag,
    )
    return found


def fit_peers() -> tuple[dict[str, _Fit], list[str]]:
    """The peers that are installed, and the names of those that are not."""
    known: list[tuple[str, _Fit, tuple[str, ...]]] = [
        ("numpy.linalg.lstsq", _lstsq, ()),
        ("normal equations by BLAS", _normal_equations, ()),
        ("scipy gelsy", _gelsy, ("scipy",)),
        ("astropy LombScargle", _astropy, ("astropy",)),
        ("statsmodels OLS", _statsmodels, ("statsmodels",)),
        ("finufft + Toeplitz", _finufft, ("finufft", "scipy")),
    ]
    found, missing = {}, []
    for name, peer, modules in known:
        if all(importlib.util.find_spec(module) for module in modules):
            found[name] = peer
        else:
            missing.append(name)
    return found, missing
