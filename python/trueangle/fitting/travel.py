"""Partial travel: where readings are missing on the circle, and what to do about it.

A joint with hard stops shows its harmonics on an arc only. There they nearly cancel
each other, and plain least squares buys a last hundredth of a degree with amplitudes of
a hundred degrees that run wild outside the arc.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .problem import Fitted, Problem

__all__ = ["Span", "choose_ridge", "covered_span"]

Array = NDArray[np.float64]

#: Readings whose positions are looked at: one lies in every degree of the travel.
_LOOKED_AT = 65_536

#: Below this condition number of the design plain least squares is harmless on an arc.
#: Orders 0..8 reach 31 on 300 deg of travel, 274 on 270 deg.
CONDITION = 30.0

#: Penalties tried, relative to the sum of weights: from "none" to "hardly any harmonics".
_PENALTIES = (0.0, *np.logspace(-9.0, 0.0, 19).tolist())

#: Parts of the arc left out in turn when there is one run only.
_BLOCKS = 10

#: The amplitudes may add up to so many times the range of the measured error. On a full
#: turn the sum of amplitudes of a smooth error is about half its range.
_REACH = 3.0


class Span(NamedTuple):
    """Stretch of the turn that was travelled, in the unit of the angles."""

    start: float
    stop: float
    full: bool


def covered_span(angles: Sequence[Array], period: float) -> Span:
    """The turn without its widest gap, or the whole turn where no gap is missing travel.

    A gap is missing travel when it is wider than 20 deg and than chance leaves between as
    many random positions (2 %). Of more than 65 536 readings every n-th is looked at.

    Parameters
    ----------
    angles : sequence of ndarray
        Positions of every run, any number of turns.
    period : float

    Returns
    -------
    Span
        ``start`` in ``[0, period)``; ``stop - start`` is below ``period`` for partial
        travel; ``(0, period, True)`` for a full turn.

    Examples
    --------
    >>> covered_span([np.linspace(-40.0, 150.0, 96)], 360.0)
    Span(start=320.0, stop=510.0, full=False)
    """
    stride = max(1, sum(x.size for x in angles) // _LOOKED_AT)
    looked_at = angles if stride == 1 else [np.ascontiguousarray(x[::stride]) for x in angles]
    return Span(*_core.covered_span(looked_at, period))


def choose_ridge(problem: Problem, weights: Sequence[Array | None]) -> float:
    r"""Tikhonov penalty for partial travel, chosen by held-out error.

    The fit minimises :math:`\sum w (y - \varepsilon)^2 + \lambda \sum w \sum_k (A_k^2 + B_k^2)`.
    Every penalty is scored on readings left out of its fit: whole runs where there are
    several, else tenths of the arc. The best is taken, and raised until the amplitudes add
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
    """
    base = [
        np.ones(len(run)) if given is None else given
        for run, given in zip(problem.runs, weights, strict=True)
    ]
    folds = _folds(problem.angles, base)
    scores = np.array(
        [
            [_held_out(problem, problem.solve(kept, penalty), held) for kept, held in folds]
            for penalty in _PENALTIES
        ]
    )
    best = int(np.argmin(scores.mean(axis=1)))
    everything = np.concatenate([e[w > 0.0] for e, w in zip(problem.errors, base, strict=True)])
    reach = _REACH * float(np.ptp(everything))
    for penalty in _PENALTIES[best:]:
        if problem.solve(base, penalty).amplitude_sum <= reach:
            break
    return float(penalty)


_Fold = tuple[list[Array], list[Array]]


def _folds(angles: Sequence[Array], base: Sequence[Array]) -> list[_Fold]:
    """Weights of the kept and of the held-out readings, per fold and run."""
    if len(base) > 1:
        held = [[w if i == j else 0.0 * w for i, w in enumerate(base)] for j in range(len(base))]
    else:
        rank = np.argsort(np.argsort(angles[0], kind="stable"), kind="stable")
        block = rank * _BLOCKS // rank.size
        held = [[np.where(block == j, base[0], 0.0)] for j in range(_BLOCKS)]
    return [([w - h for w, h in zip(base, hold, strict=True)], hold) for hold in held]


def _held_out(problem: Problem, fitted: Fitted, held: Sequence[Array]) -> float:
    """Mean squared error of the held-out readings, each whole run around its own zero."""
    total, weight = 0.0, 0.0
    for w, x, y in zip(held, problem.angles, problem.errors, strict=True):
        rows = w > 0.0
        if not rows.any():
            continue
        residual = y[rows] - fitted.predict(x[rows])
        zero = np.average(residual, weights=w[rows]) if len(held) > 1 else 0.0
        total += float(w[rows] @ (residual - zero) ** 2)
        weight += float(w[rows].sum())
    return float(total / weight)
