"""The Tikhonov penalty for partial travel, chosen by held-out error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from .problem import Problem

__all__ = ["REACH", "choose_ridge", "error_range"]

Array = NDArray[np.float64]

#: Penalties tried, relative to the sum of weights: from "none" to "hardly any harmonics".
_PENALTIES = np.array([0.0, *np.logspace(-9.0, 0.0, 19).tolist()])

#: Parts of the arc left out in turn when there is one run only.
_BLOCKS = 10

#: The same where the error does not repeat after a turn: a joint goes on to turns that the
#: fit has not seen, so whole stretches are left out.
_STRETCHES = 4

#: The amplitudes may add up to so many times the range of the measured error. On a full
#: turn the sum of amplitudes of a smooth error is about half its range.
REACH = 3.0

#: Readings whose angles and errors are looked at for the ends of blocks and the range.
_LOOKED_AT = 65_536

#: Singular values below this part of the greatest carry nothing but rounding.
_NOTHING = 1e-14


class _Fold(NamedTuple):
    """Readings left out together: the triangle of ``[1, harmonics | error]`` over them."""

    triangle: Array
    weight: float


def choose_ridge(problem: Problem, weights: Sequence[Array | None]) -> float:
    r"""Tikhonov penalty for partial travel, chosen by held-out error.

    The fit minimises :math:`\sum w (y - \varepsilon)^2 + \lambda \sum w \sum_k (A_k^2 + B_k^2)`.
    Every penalty is scored on readings left out of its fit: whole runs where there are
    several, else tenths of the arc, or quarters of the travel where the error does not repeat
    after a turn. The best is taken, and raised until the amplitudes add
    up to no more than three times the range of the measured error.

    Parameters
    ----------
    problem : Problem
    weights : sequence of (ndarray or None)
        Of every run; readings of weight 0 take no part.

    Returns
    -------
    float
        The penalty relative to the sum of weights; 0 for plain least squares.

    Notes
    -----
    Every reading is reduced once, to the triangle of its fold, which is all that the
    many fits and scores need: O(N) for N readings, whatever the number of penalties.
    """
    folds = _folds(problem, weights)
    own_zeros = len(problem.runs) > 1
    scores = np.zeros(_PENALTIES.size)
    for j, held in enumerate(folds):
        kept = [fold for i, fold in enumerate(folds) if i != j]
        if held.weight > 0.0 and any(fold.weight > 0.0 for fold in kept):
            scores += _held_out(_solutions(kept, own_zeros), held, own_zeros)
    best = int(np.argmin(scores))
    amplitudes = _solutions(folds, own_zeros)[1:]
    sums = np.hypot(amplitudes[::2], amplitudes[1::2]).sum(axis=0)
    reach = REACH * error_range(problem, weights)
    tame = np.flatnonzero(sums[best:] <= reach)
    return float(_PENALTIES[best + tame[0]] if tame.size else _PENALTIES[-1])


def _folds(problem: Problem, weights: Sequence[Array | None]) -> list[_Fold]:
    several = len(problem.runs) > 1
    found: list[tuple[Array, float]] = []
    for run, weight, angles in zip(problem.runs, weights, problem.angles, strict=True):
        ends = [] if several else _ends(angles, _BLOCKS if problem.is_periodic else _STRETCHES)
        found += _core.folds(
            (run.reference, run.indicated, weight),
            problem.period,
            *problem.design,
            problem.argument,
            ends,
            _zero(run),
            problem.threads,
        )
    return [_Fold(triangle, weight) for triangle, weight in found]


def _zero(run: CalibrationRun) -> float:
    """About the zero of a run: errors are unfolded around it."""
    stride = max(1, len(run) // _LOOKED_AT)
    return circular_mean(run.indicated[::stride] - run.reference[::stride], run.period)


def _ends(angles: Array, count: int) -> list[float]:
    """Where so many parts of the readings, equal in number, end on the travel."""
    looked_at = angles[:: max(1, angles.size // _LOOKED_AT)]
    ends: list[float] = np.quantile(looked_at, np.arange(1, count) / count).tolist()
    return ends


def _solutions(folds: Sequence[_Fold], own_zeros: bool) -> Array:
    """``[zero, A, B, ...]``, a column per penalty; the zero is 0 where runs have their own."""
    if own_zeros:
        first = None
        rows = np.vstack([fold.triangle[1:, 1:] for fold in folds])
    else:
        # The first row fixes the zero; the others are free of it.
        triangle: Array = np.asarray(
            np.linalg.qr(np.vstack([fold.triangle for fold in folds]), mode="r")
        )
        first, rows = triangle[0], triangle[1:, 1:]
    u, s, vt = np.linalg.svd(rows[:, :-1], full_matrices=False)
    moment = u.T @ rows[:, -1]
    weight = sum(fold.weight for fold in folds)
    s = np.where(s > _NOTHING * s.max(initial=0.0), s, 0.0)[:, None]
    square = s**2 + weight * _PENALTIES
    gain = np.divide(s, square, out=np.zeros_like(square), where=square > 0.0)
    harmonics = vt.T @ (gain * moment[:, None])
    zero = np.zeros((1, _PENALTIES.size))
    if first is not None and first[0] != 0.0:
        zero = ((first[-1] - first[1:-1] @ harmonics) / first[0])[None, :]
    return np.vstack([zero, harmonics])


def _held_out(solutions: Array, held: _Fold, own_zeros: bool) -> Array:
    """Mean squared error of the held-out readings, a whole run around its own zero."""
    triangle = held.triangle[1:] if own_zeros else held.triangle
    unexplained = triangle[:, :-1] @ solutions - triangle[:, -1:]
    return np.asarray(np.einsum("ij,ij->j", unexplained, unexplained) / held.weight)


def error_range(problem: Problem, weights: Sequence[Array | None]) -> float:
    """Peak-to-peak of the measured errors that count, each run around its own zero."""
    stride = max(1, sum(len(run) for run in problem.runs) // _LOOKED_AT)
    parts = []
    for run, weight in zip(problem.runs, weights, strict=True):
        error = run.indicated[::stride] - run.reference[::stride] - _zero(run)
        error = wrap(error, problem.period)
        parts.append(error if weight is None else error[weight[::stride] > 0.0])
    return float(np.ptp(np.concatenate(parts)))
