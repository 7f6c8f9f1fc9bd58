"""Choice of orders: found in what is left of the readings, kept by their significance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..support.distributions import chi_squared_quantile
from .noisespectrum import spectrum_at
from .pattern import ENCODER, pattern_series
from .projected import Projected
from .readings import SegmentReadings
from .steady import SteadyFit, fit_steady

Array = NDArray[Any]

#: Highest order looked for.
HIGHEST: Final = 128

#: Orders that are always tried first.
_FIRST: Final = 8

#: Probability of taking up any order that is not there.
_CHANCE: Final = 0.01

_ROUNDS: Final = 5


def highest_order(readings: SegmentReadings) -> int:
    """Highest order that is read at least twice per wave at the usual speed."""
    usual = float(np.median(readings.speed))
    step = float(np.median(np.diff(readings.time)[np.diff(readings.stretch) == 0]))
    return max(1, min(HIGHEST, int(0.45 / (usual * max(step, 1e-12)))))


def choose_selfcal_orders(readings: SegmentReadings) -> tuple[float, ...]:
    """Orders that stand out of the noise beside them.

    The lowest eight are fitted first, then those at which what is left peaks, until none
    does; at last those that are not significant are dropped.
    """
    most = highest_order(readings)
    orders = tuple(float(k) for k in range(1, min(_FIRST, most) + 1))
    limit = _limit(most)
    fit: SteadyFit | None = None
    stride = max(1, readings.size // 100_000)
    for _ in range(_ROUNDS):
        fit = fit_steady(readings, orders, start=fit, thorough=False, smooth=True)
        good = np.flatnonzero(fit.valid)[:100_000] if stride == 1 else _runs(fit.valid)
        theta = readings.angle[good] - _series(fit, good)
        others = np.array([k for k in range(1, most + 1) if k not in orders], dtype=np.float64)
        if others.size == 0:
            break
        power = spectrum_at(theta, fit.residuals[good], others)
        beside = spectrum_at(theta, fit.residuals[good], others + 0.37)
        level = np.maximum(1.0, _running_mean(beside / 2.0))
        new = others[power / level > limit]
        if new.size == 0:
            break
        orders = tuple(sorted({*orders, *(float(k) for k in new)}))
    assert fit is not None
    if fit.orders != orders:
        fit = fit_steady(readings, orders, start=fit, thorough=False, smooth=True)
    return significant_orders(
        fit.projected, fit.unknowns, fit.projected.covariance, orders, ENCODER, most
    )


def _limit(tried: int) -> float:
    return chi_squared_quantile(1.0 - _CHANCE / max(tried, 1), 2.0)


def _series(fit: SteadyFit, rows: Array) -> Array:
    angle = fit.readings.angle[rows]
    return pattern_series(fit.orders, fit.pattern, angle)


def _runs(valid: Array) -> Array:
    """A hundred pieces of a thousand neighbours, over the whole log."""
    starts = np.linspace(0, valid.size - 1000, 100).astype(np.int64)
    rows = (starts[:, None] + np.arange(1000)).ravel()
    return np.unique(rows[valid[rows]])


def _running_mean(values: Array) -> Array:
    kernel = np.ones(min(9, values.size))
    return np.asarray(
        np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")
    )


def significant_orders(
    projected: Projected,
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    among: Sequence[float],
    source: str | None = None,
    tried: int | None = None,
) -> tuple[float, ...]:
    """Orders of ``among`` whose cosine and sine together are significant, of so many tried."""
    limit = _limit(len(among) if tried is None else tried)
    kept = []
    for order in among:
        at = [
            i
            for i, column in enumerate(projected.columns)
            if column.order == order and column.part and source in (None, column.source)
        ]
        block, value = covariance[np.ix_(at, at)], coefficients[at]
        size = float(value @ np.linalg.pinv(block, hermitian=True) @ value)
        if size > limit:
            kept.append(order)
    return tuple(kept)
