"""Orders that the rounding of a coarse sensor makes at positions that are evenly spaced."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.factor import orthonormal_basis
from ...estimation.rounded import fit_rounded, is_rounding_visible
from ...joint.pattern import lines_columns
from ...support.arrays import Array
from .zerogroups import ZeroGroupReadings


def orders_beyond_rounding(
    units: Sequence[ZeroGroupReadings],
    step: float,
    orders: Sequence[float],
    limit: float,
    forced: int = 0,
) -> list[int]:
    """Places of the orders that rounding alone does not explain, the strongest first.

    Parameters
    ----------
    units : sequence of ZeroGroupReadings
    step : float
        Of the sensor, in the unit of the errors.
    orders : sequence of float
        Strongest first; the first ``forced`` of them are always in the model and not returned.
    limit : float
        Log of the p-value below which an order is accepted: by the likelihood ratio for both of its
        coefficients, which without it is χ² with two degrees of freedom.
    """
    error = np.concatenate([unit.error for unit in units])
    theta = 2.0 * np.pi * np.concatenate([unit.turns for unit in units])
    zeros = np.repeat(np.eye(len(units)), [unit.turns.size for unit in units], axis=0)
    lines = lines_columns(theta, np.asarray(orders, dtype=np.float64))

    def columns(places: Sequence[int]) -> Array:
        return np.hstack([zeros, *(lines[:, 2 * k : 2 * k + 2] for k in places)])

    left = error - _fitted(columns(range(len(orders))), error)
    about = error - _fitted(zeros, error)
    if not is_rounding_visible(step**2 / 12.0, float(np.var(left)), float(np.var(about))):
        return list(range(forced, len(orders)))
    told = list(range(forced))
    fit = fit_rounded(orthonormal_basis(columns(told)), error, step)
    for k in range(forced, len(orders)):
        if fit.within:
            break
        other = fit_rounded(orthonormal_basis(columns([*told, k])), error, step)
        if fit.log_likelihood - other.log_likelihood < limit:
            told.append(k)
            fit = other
    return told[forced:]


def _fitted(columns: Array, error: Array) -> Array:
    basis = orthonormal_basis(columns)
    return np.asarray(basis @ (basis.T @ error))
