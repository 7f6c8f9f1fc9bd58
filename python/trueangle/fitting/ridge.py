"""The Tikhonov penalty for partial travel, chosen by held-out error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from .problem import Problem

__all__ = ["REACH", "choose_ridge", "error_range"]

Array = NDArray[np.float64]

#: Penalties tried, relative to the sum of weights: from "none" to "hardly any harmonics".
_PENALTIES = [0.0, *np.logspace(-9.0, 0.0, 19).tolist()]

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


def choose_ridge(problem: Problem, weights: Sequence[Array | None]) -> float:
    """Tikhonov penalty for partial travel, chosen by held-out error.

    The fit minimises ``Σ w (y - ε)² + λ Σ w Σ_k (A_k² + B_k²)``.
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
    amplitudes, scores = _core.ridge_path(
        _folds(problem, weights), len(problem.runs) > 1, _PENALTIES
    )
    best = int(np.argmin(scores))
    sums = np.hypot(amplitudes[::2], amplitudes[1::2]).sum(axis=0)
    reach = REACH * error_range(problem, weights)
    tame = np.flatnonzero(sums[best:] <= reach)
    return float(_PENALTIES[best + tame[0]] if tame.size else _PENALTIES[-1])


def _folds(problem: Problem, weights: Sequence[Array | None]) -> list[tuple[Array, float]]:
    """Triangles of ``[1 | harmonics | error]`` over readings left out together, and weights."""
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
    return found


def _zero(run: CalibrationRun) -> float:
    """About the zero of a run: errors are unfolded around it."""
    stride = max(1, len(run) // _LOOKED_AT)
    return circular_mean(run.indicated[::stride] - run.reference[::stride], run.period)


def _ends(angles: Array, count: int) -> list[float]:
    """Where so many parts of the readings, equal in number, end on the travel."""
    looked_at = angles[:: max(1, angles.size // _LOOKED_AT)]
    ends: list[float] = np.quantile(looked_at, np.arange(1, count) / count).tolist()
    return ends


def error_range(problem: Problem, weights: Sequence[Array | None]) -> float:
    """Peak-to-peak of the measured errors that count, each run around its own zero."""
    stride = max(1, sum(len(run) for run in problem.runs) // _LOOKED_AT)
    parts = []
    for run, weight in zip(problem.runs, weights, strict=True):
        error = run.indicated[::stride] - run.reference[::stride] - _zero(run)
        error = wrap(error, problem.period)
        parts.append(error if weight is None else error[weight[::stride] > 0.0])
    return float(np.ptp(np.concatenate(parts)))
