"""The Tikhonov penalty for partial travel, chosen by held-out error: its variances and bias.

A ridge answers ``b̂ = (G + λ)⁻¹ X'Wy`` and is off by

::

    b̂ - b = (G + λ)⁻¹ X'W e - λ (G + λ)⁻¹ b

The first part is noise. The second depends on the pattern itself, and just where the readings
determine little of it. Patterns are treated as random, with variances ``τ² (k / k₀)^(-2q)`` of both
coefficients of order k, ``k₀`` the lowest of its shaft; the marginal likelihood of the readings
gives the probability of each size ``τ`` and steepness q. With
``D`` the mean of these variances the covariance of the second part is

::

    λ² (G + λ)⁻¹ D (G + λ)⁻¹

Intervals from the sum of both reach their stated coverage on average over the travel and over
patterns (Wahba 1983, Nychka 1988): not for each angle by itself, and not for a
pattern whose sizes nothing in the travel shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

import trueangle._core as _core

from ..estimation.linear import pseudo_inverse
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.arrays import Array
from .problem import Problem

#: Penalties tried, relative to the sum of weights: from "none" to "hardly any harmonics".
_PENALTIES = [0.0, *np.logspace(-9.0, 0.0, 19).tolist()]


#: Bound of the sum of the amplitudes, in ranges of the measured error. On a full
#: turn the sum of amplitudes of a smooth error is about half its range.
REACH = 3.0

#: Readings whose angles and errors are looked at for the ends of blocks and the range.
_LOOKED_AT = 65_536

#: How fast sizes fall with the order: not at all, up to twice as fast as those of a kink.
_STEEPNESS: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)

#: Sizes looked at, relative to the greatest: four decades, 20 to each.
_SIZES: Final = np.logspace(-4.0, 0.0, 81)


def choose_ridge(problem: Problem, weights: Sequence[Array | None]) -> float:
    """Tikhonov penalty for partial travel, chosen by held-out error.

    The fit minimises ``Σ w (y - ε)² + λ Σ w Σ_k (A_k² + B_k²)``.
    Every penalty is scored on readings held out of its fit: whole runs where there are
    several, else tenths of the arc, or quarters of the travel where the error does not repeat
    after a turn. The best is taken, and raised until the amplitudes add
    up to at most three times the range of the measured error.

    Readings of weight 0 take no part. The penalty is relative to the sum of weights; 0 is plain
    least squares.

    Notes
    -----
    Every reading is reduced once, to the triangle of its fold, which is all that the
    many fits and scores need: O(N) for N readings, for any number of penalties.
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
    """Triangles of ``[1 | harmonics | error]`` over readings held out together, and weights."""
    several = len(problem.runs) > 1
    found: list[tuple[Array, float]] = []
    for run, weight, angles in zip(problem.runs, weights, problem.angles, strict=True):
        # Parts of the arc held out in turn; where the error does not repeat after a turn, whole
        # segments: a joint goes on to turns outside the fitted travel.
        ends = [] if several else _ends(angles, 10 if problem.is_periodic else 4)
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
    """Where ``count`` parts with equally many readings end on the travel."""
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


def pattern_variances(
    gram: Array, moment: Array, variance: float, steps: Array, greatest: float
) -> Array:
    """Mean variance of every coefficient, over the sizes and slopes that the readings allow.

    ::

        D_i = Σ_{q,τ} p(q, τ | y) τ² s_i^(-2q),
        y ~ N(0, σ² + τ² X S^(-2q) X')

    with every slope, and every decade of sizes below the greatest, equally probable beforehand.

    ``gram`` and ``moment`` are ``X'WX`` and ``X'Wy`` about the zeros of the runs, ``variance`` is
    that of a reading of weight 1, ``steps`` the order of every coefficient relative to the lowest
    of its shaft, and no pattern exceeds the size ``greatest``.

    Examples
    --------
    Where the readings determine everything, it is the mean square of the coefficients:

    >>> b = np.tile([3.0, -4.0], 50)
    >>> found = pattern_variances(1e6 * np.eye(100), 1e6 * b, 1.0, np.ones(100), 100.0)
    >>> round(float(found[0]), 1)
    12.8
    """
    if not greatest > 0.0:
        return np.zeros(moment.size)
    # Noise counts as at least this part of the greatest size: rounding, where there is no noise.
    noise = max(variance, (1e-9 * greatest) ** 2)
    squares = (greatest * _SIZES) ** 2
    values, vectors = np.linalg.eigh(gram)
    seen = values > 1e-14 * values[-1]
    root = vectors[:, seen] * np.sqrt(values[seen])
    whitened = vectors[:, seen].T @ moment / np.sqrt(values[seen])
    evidence, shapes = [], []
    for steepness in _STEEPNESS:
        shape = steps**-steepness
        rows = root * shape[:, None]
        spread, turn = np.linalg.eigh(rows.T @ rows)
        expected = noise + np.outer(squares, np.maximum(spread, 0.0))
        misfit = (turn.T @ whitened) ** 2 / expected
        evidence.append(-0.5 * np.sum(np.log(expected) + misfit, axis=1))
        shapes.append(shape**2)
    chance = np.exp(np.array(evidence) - np.max(evidence))
    return np.asarray((chance @ squares) @ np.array(shapes) / chance.sum())


def bias_covariance(gram: Array, means: Array, penalty: float, variances: Array) -> Array:
    """Covariance of what a penalty takes from ``[constant, A, B, ...]``.

    ::

        M λ² (G + λ)⁻¹ D (G + λ)⁻¹ M',    M = [-x̄'; I]

    for the constant makes good on the readings what the coefficients are off by there.

    ``means`` are those of every regressor over the readings (of the runs), ``penalty`` is what the
    diagonal of ``gram`` gets, ``variances`` are those of `pattern_variances`.
    """
    taken = penalty * pseudo_inverse(gram + penalty * np.eye(len(gram)))
    taken = np.vstack([-means @ taken, taken])
    return np.asarray((taken * variances) @ taken.T)
