"""Do the runs show one pattern? Runs of another joint, or of a joint that was changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

import trueangle._core as _core

from ..estimation.evidence import CorrelatedNoise
from ..estimation.linear import NormalEquations, linear_residual, total
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.arrays import Array, median
from ..support.display_units import brief_number
from ..support.distributions import f_tail
from .problem import Problem, SolvedProblem

#: Readings of a run that are looked at, and runs.
_READINGS: Final = 512

#: ... and by this many times the scatter that its noise, correlated as it is, gives coefficients.
_SCATTER: Final = 25.0


#: Runs that a sentence names.
_NAMED: Final = 8


def unlike_runs(problem: Problem, fitted: SolvedProblem) -> list[int]:
    """Runs whose own coefficients are far from those of all, in order; see `far_runs`.

    Of every run 512 readings at most are looked at; the correlation of neighbours in time
    widens what counts as noise.
    """
    count = len(problem.runs)
    if count < 2 or not problem.shafts:
        return []
    chosen = [i for i in range(0, count, max(1, count // 512)) if not np.isnan(fitted.offsets[i])]
    far = far_runs([_sums(problem, i) for i in chosen])
    return [chosen[i] for i, times in far if times > _SCATTER * _correlated(problem, chosen[i])]


def far_runs(runs: Sequence[NormalEquations]) -> list[tuple[int, float]]:
    """Places of runs that differ from the others, and by how many times their noise.

    With ``S_r(b)`` the sum of squares of run r about its own zero, the runs for which

    ::

        S_r(b) - S_r(b_r) > 0.2 [S_r(0) - S_r(b_r)]

    and 25 times what noise alone would make, where ``b`` are the common coefficients,
    ``b_r`` those of the run alone; with three runs and more that each hold all orders ``b`` is
    their median.
    """
    if len(runs) < 2:
        return []
    alone = [_solved(run) for run in runs]
    # Most runs decide where each can speak: one that differs moves the mean of all.
    if len(runs) > 2 and all(clear for _, _, clear in alone):
        common = median([solution for solution, _, _ in alone], axis=0)
    else:
        common, _, _ = _solved(total(runs))
    # The common pattern of two holds half of each.
    without = 4.0 if len(runs) == 2 else 1.0
    missed, own, noise, free, rank = np.zeros((5, len(runs)))
    for i, (run, (solution, seen, _)) in enumerate(zip(runs, alone, strict=True)):
        apart = solution - common
        own[i] = run.moment @ solution
        noise[i], rank[i] = max(0.0, run.squares - own[i]), seen
        free[i] = max(0.0, run.readings - 1.0 - seen)
        missed[i] = without * max(0.0, float(apart @ run.gram @ apart))
    if free.sum() < 1.0:
        return []
    noisy = noise.sum() / free.sum() * np.maximum(rank, 1.0)
    # A run is unlike the others when their pattern misses this share of the energy that its own
    # would explain (its coefficients are about half of the pattern off) ...
    far = np.flatnonzero((missed > 0.2 * own) & (missed > _SCATTER * noisy))
    return [(i, float(missed[i] / max(noisy[i], 1e-300))) for i in far.tolist()]


def _solved(sums: NormalEquations) -> tuple[Array, int, bool]:
    """Least squares from normal equations: its rank, and whether it is well determined."""
    found = sums.solved()
    values = np.linalg.eigvalsh(sums.gram)
    # Where no direction of a run's design is shorter than a tenth of the longest, each
    # coefficient of the run alone means something.
    clear = bool(values[0] > 0.01 * values[-1])
    return found.coefficients[:, 0], found.rank, clear


def run_names(runs: Sequence[CalibrationRun]) -> list[str]:
    """What to call each run: its label, or its file if that differs between runs, or its number."""
    labels = [run.label or "" for run in runs]
    files = ["" if run.source is None else run.source.file for run in runs]
    several = len(set(files)) > 1
    alike = len({*labels}) < len(labels)
    return [
        ":".join(filter(None, (file if several and (alike or not label) else "", label)))
        or str(number)
        for number, (file, label) in enumerate(zip(files, labels, strict=True), 1)
    ]


def unlike_runs_sentence(labels: Sequence[str], count: int) -> str:
    """A sentence on runs that differ from the others."""
    more = f" and {len(labels) - _NAMED} more" if len(labels) > _NAMED else ""
    which = f"run{'s' if len(labels) > 1 else ''} {', '.join(labels[:_NAMED])}{more}"
    return (
        f"the runs have different patterns: the coefficients of {which} (of {count}) "
        "differ from the common ones far beyond their errors. Fit different joints separately, "
        "or find what changed between the runs"
    )


def _sums(problem: Problem, index: int) -> NormalEquations:
    if problem.summed is not None:
        sums = NormalEquations.of_products(problem.products(problem.base, index))
        return sums.share(min(1.0, _READINGS / sums.readings))
    rows, used = _rows(problem, index)
    return replace(NormalEquations.of_rows(rows[:, :-1], rows[:, -1]), readings=used)


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
    """By how much correlated noise widens the variances of a run's own coefficients."""
    run = problem.runs[index]
    both = np.column_stack([problem.columns(index), run.centred_error])
    both -= both.mean(axis=0)
    columns, left = both[:, :-1], linear_residual(both[:, :-1], both[:, -1])
    scale = float(left @ left) / len(run)
    if not scale > 0.0:
        return 1.0
    return float(np.mean(CorrelatedNoise.of([columns], [left], scale).widening([columns]) ** 2))


def zeros_follow_speed(runs: Sequence[CalibrationRun], zeros: Array, std: Array) -> list[str]:
    """A sentence where the zeros follow the mean speeds of the runs, as with a delay τ.

    ::

        z_r = z - τ v_r,    F = τ² Σ (v_r - v̄)² / max(s², u²)

    with ``s²`` the variance of the zeros about the line and ``u`` their standard error. None of
    fewer than 3 timed runs, of one speed, and where the p-value is above 0.001.
    """
    means = np.array([np.nan if (v := run.speed) is None else v.mean() for run in runs])
    timed = np.isfinite(means) & np.isfinite(zeros)
    # Runs from which on a line through their zeros can fail.
    if timed.sum() < 3:
        return []
    speed, period = means[timed], runs[0].period
    zero = wrap(zeros[timed] - circular_mean(zeros[timed], period), period)
    speed, zero = speed - speed.mean(), zero - zero.mean()
    energy, freedom = float(speed @ speed), int(timed.sum()) - 2
    if energy == 0.0:
        return []
    slope = float(speed @ zero) / energy
    rest = zero - slope * speed
    noise = max(float(rest @ rest) / freedom, float(np.nanmean(std[timed] ** 2)), 1e-300)
    chance = f_tail(slope**2 * energy / noise, 1.0, float(freedom))
    # Probability below which zeros that do not follow the speed would do so.
    if chance >= 1e-3:
        return []
    return [
        "the zeros of the runs follow their speed, as with a delay of "
        f"{brief_number(-1e3 * slope)} ms (p = {chance:.1g}): the model corrects only their mean. "
        "Run diagnose, which separates a delay from a reversal error"
    ]
