"""How large an error that every run draws anew is: the best ratio of its variance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["best_ratio"]

Array = NDArray[np.float64]

#: Ratios of variance (run effect to one reading) that are tried; every so many first, as the
#: maximum is broad. Between the best of them and its neighbours a parabola tells it.
RATIOS = np.geomspace(1e-5, 1e8, 53)
COARSE = 4

#: Share of the strongest column's power from which on one counts.
COUNTS = 1e-12

#: Columns up to which all ratios follow from one eigensystem of theirs.
FEW_COLUMNS = 40


def best_ratio(
    grams: Array, moments: Array, deviances: Callable[[Array], Array]
) -> tuple[float, float]:
    """Best ratio of variances of a run effect beside what is fitted, and what it saves.

    With the columns of all runs turned to right angles, of power D, and B their share in
    the fitted ones, a ratio t saves

    ::

        bᵀ (I / t + D - D^(1/2) B Bᵀ D^(1/2))⁻¹ b

    of the squares, b their products with the residual.

    Parameters
    ----------
    grams : ndarray, shape (runs, k, k)
        Products of the run effect's columns in every run, whitened.
    moments : ndarray, shape (runs, k, p + 1)
        Their products with what is fitted, whitened and orthonormal, and with what that leaves.
    deviances : callable
        Deviance that so many squares saved are worth.

    Returns
    -------
    float, float
        The ratio, 0 where none saves anything, and the deviance saved.
    """
    values, vectors = np.linalg.eigh(grams)
    values = np.maximum(values, 0.0)
    moment = np.swapaxes(vectors, 1, 2) @ moments
    kept = values > COUNTS * values.max(initial=1e-300)
    power = values[kept]
    b = (moment / np.sqrt(np.where(kept, values, 1.0))[:, :, None])[kept]
    trials = RATIOS / max(float(power.max(initial=0.0)), 1e-300)
    squares = _few if power.size <= FEW_COLUMNS else _many
    saved = squares(power, b[:, :-1], b[:, -1])

    def deviance(chosen: Array) -> Array:
        paid = np.log1p(np.outer(chosen, power)).sum(axis=1)
        return np.asarray(deviances(saved(chosen)) - paid)

    middle = COARSE * int(np.argmax(deviance(trials[::COARSE])))
    near = trials[max(middle - COARSE, 0) : middle + COARSE + 1]
    found = deviance(near)
    k = int(np.argmax(found))
    best = float(near[k]), float(found[k])
    if best[1] <= 0.0:
        return 0.0, 0.0
    if 0 < k < near.size - 1:
        top = best[0] * (near[1] / near[0]) ** _vertex(*found[k - 1 : k + 2].tolist())
        best = max(best, (float(top), float(deviance(np.array([top]))[0])), key=lambda b: b[1])
    return best


def _vertex(before: float, at: float, after: float) -> float:
    """Where a parabola through three points one apart is highest, from the middle one on."""
    bend = before - 2.0 * at + after
    return 0.5 * (before - after) / bend if bend < 0.0 else 0.0


def _few(power: Array, bq: Array, br: Array) -> Callable[[Array], Array]:
    """Squares saved at ratios, by the eigensystem of the columns beside the fitted ones."""
    root = np.sqrt(power)
    values, vectors = np.linalg.eigh(np.outer(root, root) * (np.eye(power.size) - bq @ bq.T))
    values = np.maximum(values, 0.0)
    squares = (vectors.T @ (root * br)) ** 2
    return lambda t: np.asarray((t[:, None] / (1.0 + np.outer(t, values))) @ squares)


def _many(power: Array, bq: Array, br: Array) -> Callable[[Array], Array]:
    """As `_few`, by a system of the size of the fitted columns for every ratio."""

    def saved(t: Array) -> Array:
        x = np.outer(t, power)
        shrink = x / (1.0 + x)
        cross = (shrink * br) @ bq
        inner = np.eye(bq.shape[1]) - (bq.T[None] * shrink[:, None, :]) @ bq
        inner += 1e-12 * np.eye(bq.shape[1])
        solved = np.linalg.solve(inner, cross[:, :, None])[:, :, 0]
        return np.asarray(shrink @ br**2 + np.einsum("tp,tp->t", cross, solved))

    return saved
