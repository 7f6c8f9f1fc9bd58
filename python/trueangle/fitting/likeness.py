"""Do the runs show one pattern? Runs of another joint, or of a joint that was changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..angles import circular_mean
from .problem import Fitted, Problem

__all__ = ["unlike_runs", "unlike_sentence"]

Array = NDArray[np.float64]

#: Readings of a run that are looked at, and runs.
_READINGS: Final = 512
_RUNS: Final = 512

#: A run is unlike the others when their pattern misses this share of the energy that its own
#: would explain (its coefficients are about half of the pattern off) ...
_SHARE: Final = 0.2
#: ... and by so many times what its noise, correlated as it is, lets coefficients scatter.
_SCATTER: Final = 25.0

#: Directions of a run's design below this part of the longest are not seen by it.
_SEEN: Final = 1e-6

#: Above this part of the longest each coefficient of a run alone means something.
_SPEAKS: Final = 0.1

#: Runs that a sentence names.
_NAMED: Final = 8


def unlike_runs(problem: Problem, fitted: Fitted) -> list[int]:
    r"""Runs whose own coefficients are far from those of all, in order.

    With :math:`S_r(b)` the sum of squares of run r about its own zero, the runs for which

    .. math:: S_r(b) - S_r(b_r) > 0.2 \, [S_r(0) - S_r(b_r)]

    and 25 times what noise alone would make of it, where ``b`` are the common coefficients,
    ``b_r`` those of the run alone; with three runs and more that each hold all orders ``b`` is
    their median. Of every run 512 readings at most are looked at; the
    correlation of neighbours in time widens what counts as noise.
    """
    count = len(problem.runs)
    if count < 2 or not problem.shafts:
        return []
    chosen = [i for i in range(0, count, max(1, count // _RUNS)) if not np.isnan(fitted.offsets[i])]
    parts = [_rows(problem, i) for i in chosen]
    alone = [np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=_SEEN) for rows, _ in parts]
    # Most runs decide where each can speak: one that is unlike moves the mean of all.
    if len(alone) > 2 and all(s.min() > _SPEAKS * s.max() for *_, s in alone):
        common = np.median([solution for solution, *_ in alone], axis=0)
    else:
        every = np.vstack([rows for rows, _ in parts])
        common = np.linalg.lstsq(every[:, :-1], every[:, -1], rcond=_SEEN)[0]
    # The common pattern of two holds half of each.
    without = 4.0 if len(chosen) == 2 else 1.0
    missed, own, noise, free, rank = np.zeros((5, count))
    for i, (rows, used), (solution, _, seen, _) in zip(chosen, parts, alone, strict=True):
        left = rows[:, -1] - rows[:, :-1] @ common
        rest = rows[:, -1] - rows[:, :-1] @ solution
        noise[i], rank[i], free[i] = rest @ rest, seen, max(0.0, used - 1.0 - seen)
        missed[i] = max(0.0, without * (left @ left - noise[i]))
        own[i] = rows[:, -1] @ rows[:, -1] - noise[i]
    if free.sum() < 1.0:
        return []
    noisy = noise.sum() / free.sum() * np.maximum(rank, 1.0)
    far = np.flatnonzero((missed > _SHARE * own) & (missed > _SCATTER * noisy))
    return [i for i in far.tolist() if missed[i] > _SCATTER * noisy[i] * _correlated(problem, i)]


def unlike_sentence(problem: Problem, runs: Sequence[int]) -> str:
    """What to tell of runs that are unlike the others."""
    labels = [problem.runs[i].label or str(i + 1) for i in runs]
    more = f" and {len(labels) - _NAMED} more" if len(labels) > _NAMED else ""
    which = f"run{'s' if len(labels) > 1 else ''} {', '.join(labels[:_NAMED])}{more}"
    return (
        f"the runs do not show one pattern: the coefficients of {which} (of {len(problem.runs)}) "
        "differ from the common ones far beyond their errors; fit apart what is not one joint, "
        "or look for what changed between the runs"
    )


def _rows(problem: Problem, index: int) -> tuple[Array, float]:
    """Triangle of ``[harmonics | error]`` of a run about its own zero, and readings used."""
    run, weights = problem.runs[index], problem.base[index]
    x, y = run.reference, run.indicated
    if len(run) > _READINGS:
        rows = np.random.default_rng(0).integers(0, len(run), _READINGS)
        x, y = x[rows], y[rows]
        weights = None if weights is None else weights[rows]
    used = float(x.size if weights is None else np.count_nonzero(weights))
    triangle = _core.triangle(
        (x, y, weights),
        problem.period,
        [shaft.cycles_per_turn for shaft in problem.shafts],
        [list(shaft.orders) for shaft in problem.shafts],
        problem.argument,
        circular_mean(y - x, problem.period),
        1,
    )
    return triangle[1:, 1:], used


def _correlated(problem: Problem, index: int) -> float:
    """By how much correlated neighbours widen the scatter of a run's own coefficients."""
    run = problem.runs[index]
    rows, _ = _rows(problem, index)
    own = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=_SEEN)[0]
    left = run.centred_error - run.zero
    place = 2.0 * np.pi / problem.period * problem.angles[index]
    orders = [k * s.cycles_per_turn for s in problem.shafts for k in s.orders]
    for order, (a, b) in zip(orders, own.reshape(-1, 2).tolist(), strict=True):
        left = left - a * np.cos(order * place) - b * np.sin(order * place)
    left = left - left.mean()
    energy = float(left @ left)
    near = float(left[1:] @ left[:-1]) / energy if energy > 0.0 else 0.0
    near = min(max(near, 0.0), 1.0 - 1.0 / len(run))
    return (1.0 + near) / (1.0 - near)
