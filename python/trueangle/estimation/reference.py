"""The slow truth in plain numpy: error and slope, correction and least-squares fit.

Every function here does the obvious thing with one sine and one cosine per order and
the whole design matrix in memory. Tests compare the compiled core with it, benchmarks
measure the core's gain over it; use the core for work.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..runs.run import CalibrationRun, as_runs
from ..support.arrays import Array

if TYPE_CHECKING:
    from ..model.model import HarmonicModel


def design_matrix(
    theta: ArrayLike,
    shafts: Iterable[tuple[float, Sequence[int]]],
    period: float = 2.0 * math.pi,
    *,
    constant: bool = True,
) -> Array:
    """Columns ``[1, cos(k f x), sin(k f x), ...]`` at the angles ``theta``.

    Parameters
    ----------
    theta : array_like, shape (n,)
    shafts : iterable of (cycles_per_turn, orders)
    period : float
    constant : bool
        Whether the column of ones comes first.

    Returns
    -------
    ndarray, shape (n, 2 * orders + constant)

    Examples
    --------
    >>> design_matrix([0.0, 90.0], [(1.0, [1])], period=360.0).round(12)
    array([[1., 1., 0.],
           [1., 0., 1.]])
    """
    x = np.asarray(theta, dtype=np.float64) * (2.0 * math.pi / period)
    columns = [np.ones_like(x)] if constant else []
    for cycles, orders in shafts:
        for order in orders:
            columns += [np.cos(order * cycles * x), np.sin(order * cycles * x)]
    return np.stack(columns, axis=-1) if columns else np.zeros((x.size, 0))


def error(model: HarmonicModel, theta: ArrayLike) -> Array:
    """``model.error(theta)``, one cosine and one sine per order and sample."""
    x = np.asarray(theta, dtype=np.float64) * (2.0 * math.pi / model.period)
    total = np.full_like(x, model.constant)
    for shaft in model.shafts:
        for order, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
            phase = order * shaft.cycles_per_turn * x
            total += a * np.cos(phase) + b * np.sin(phase)
    return total


def slope(model: HarmonicModel, theta: ArrayLike) -> Array:
    """``d error / d theta``, term by term."""
    unit = 2.0 * math.pi / model.period
    x = np.asarray(theta, dtype=np.float64) * unit
    total = np.zeros_like(x)
    for shaft in model.shafts:
        for order, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
            rate = order * shaft.cycles_per_turn
            total += unit * rate * (b * np.cos(rate * x) - a * np.sin(rate * x))
    return total


def correct(model: HarmonicModel, indicated: ArrayLike) -> Array:
    """``model.correct(indicated)`` by Newton iteration on the whole array."""
    reading = np.asarray(indicated, dtype=np.float64)
    if model.argument == "indicated":
        return reading - error(model, reading)
    theta = reading - model.constant
    # Newton steps allowed; the iteration is quadratic and starts within half a turn.
    for _ in range(50):
        step = (theta + error(model, theta) - reading) / (1.0 + slope(model, theta))
        theta = theta - step
        if not (np.abs(step) > 4.0 * np.finfo(float).eps * np.abs(theta)).any():
            break
    return theta


class _ReferenceFit(NamedTuple):
    """What `fit` returns, in the unit of the runs."""

    coefficients: Array
    """``A, B`` of each order of each shaft in turn."""
    offsets: Array
    """Zero of each run."""
    covariance: Array
    """Of ``[coefficients]``, scaled by the residual variance."""
    residuals: Array
    """Measured minus fitted, run after run."""


def fit(
    runs: CalibrationRun | Iterable[CalibrationRun],
    shafts: Sequence[tuple[float, Sequence[int]]],
    argument: str = "reference",
) -> _ReferenceFit:
    """Least squares by `numpy.linalg.lstsq` with one column of ones per run.

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    shafts : sequence of (cycles_per_turn, orders)
    argument : {"reference", "indicated"}
    """
    found = as_runs(runs)
    period = found[0].period
    x = np.concatenate([getattr(run, argument) for run in found])
    y = np.concatenate([run.centred_error for run in found])
    labels = np.repeat(np.arange(len(found)), [len(run) for run in found])
    ones = (labels[:, None] == np.arange(len(found))).astype(np.float64)
    design = np.hstack([design_matrix(x, shafts, period, constant=False), ones])
    w = np.concatenate(
        [np.ones(len(run)) if run.weights is None else np.sqrt(run.weights) for run in found]
    )
    solution, *_ = np.linalg.lstsq(design * w[:, None], y * w, rcond=None)
    residuals = y - design @ solution
    freedom = np.count_nonzero(w) - design.shape[1]
    variance = float((w * residuals) @ (w * residuals)) / freedom if freedom > 0 else math.nan
    gram = (design * w[:, None]).T @ (design * w[:, None])
    harmonics = design.shape[1] - len(found)
    return _ReferenceFit(
        solution[:harmonics],
        solution[harmonics:],
        variance * np.linalg.inv(gram)[:harmonics, :harmonics],
        residuals,
    )
