"""Columns of the effects other than the pattern, one group for each nuisance.

Each is taken about its run's mean, which the zero of that run takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ..runs.run import CalibrationRun
from ..support.arrays import Array
from .nuisance import KINDS, Nuisance
from .nuisancechoice import FOLDS, FoldRows

#: Most runs that may each have a separate drift, or separate lines of the reference.
_MOST_DRIFTING: Final = 24


def nuisance_columns(
    runs: Sequence[CalibrationRun],
    orders: Sequence[float],
    argument: str,
    stride: int,
    kinds: tuple[str, ...] | None,
    reference_orders: Sequence[float],
) -> FoldRows:
    """Pattern, nuisances and errors of every ``stride``-th reading; ``kinds`` of None are all."""
    wanted = KINDS if kinds is None else kinds
    timed = all(run.time is not None and np.ptp(run.time) > 0.0 for run in runs)
    speeds = [run.speed for run in runs] if "velocity" in wanted else []
    parts: dict[str, list[Array]] = {}
    patterns, errors, folds = [], [], []
    for i, run in enumerate(runs):
        take = slice(None, None, stride)
        x = (2.0 * np.pi / run.period * getattr(run, argument))[take, None]
        angular = x * np.asarray(orders)
        weight = np.ones(len(run)) if run.weights is None else run.weights
        mine = {"ramp": run.unwrapped_reference[take, None]} if "ramp" in wanted else {}
        if "direction" in wanted:
            mine["direction"] = run.direction[take, None]
        if speeds and all(speed is not None for speed in speeds):
            mine["velocity"] = np.asarray(speeds[i])[take, None]
        if reference_orders:
            lines = (2.0 * np.pi / run.period * run.reference)[take, None] * reference_orders
            both = np.stack([np.cos(lines), np.sin(lines)], 2).reshape(len(x), -1)
            mine["reference"] = both
            if 1 < len(runs) <= _MOST_DRIFTING:
                mine["turned"] = _of_run(both, i, len(runs))
        if "drift" in wanted and timed and len(runs) <= _MOST_DRIFTING:
            assert run.time is not None
            # Intervals of the spline of a run's time that are tried, from a cubic on.
            for count in (1, 2, 4, 6):
                own = time_spline(run.time[take], run.time, count)
                mine[f"drift{count}"] = _of_run(own, i, len(runs))
        used = weight[take]
        for name, columns in mine.items():
            parts.setdefault(name, []).append(_about(columns, used))
        patterns.append(_about(np.hstack([np.cos(angular), np.sin(angular)]), used))
        errors.append(_about(run.centred_error[take, None], used)[:, 0])
        # Segments of each run that are held out, every third together: twice as long as the reach
        # of the stiffest spline tested on them. An odd number: way and return differ in fold.
        folds.append((np.arange(len(x)) * 13 // len(x) + i) % FOLDS)
    groups = {name: np.vstack(v) for name, v in parts.items()}
    return FoldRows(
        np.vstack(patterns),
        {name: v for name, v in groups.items() if np.abs(v).max() > 0.0},
        np.concatenate(errors),
        np.concatenate(folds),
    )


def taken_columns(
    runs: Sequence[CalibrationRun], nuisance: Nuisance
) -> tuple[list[Array], list[Array]] | None:
    """Columns of each run that were taken out: what runs share, and what each has for itself.

    Each about its run's mean and of size 1. None where there are none, and where they came from
    a part of the readings.
    """
    if not nuisance.kinds or looked_at_stride(runs) > 1:
        return None
    lines = [order for order, *_ in (*nuisance.reference, *nuisance.turned)]
    plain = [replace(run, weights=None) for run in runs]
    kinds = tuple(kind for kind in nuisance.kinds if kind in KINDS)
    groups = nuisance_columns(plain, (), "reference", 1, kinds, lines).groups
    named = [f"drift{nuisance.intervals}" if k == "drift" else k for k in nuisance.kinds]
    ends = np.cumsum([len(run) for run in runs])[:-1]
    shared, own = [np.zeros((sum(map(len, runs)), 0))], [np.zeros((sum(map(len, runs)), 0))]
    for name in named:
        columns = groups[name] / np.sqrt(np.maximum((groups[name] ** 2).mean(axis=0), 1e-300))
        (own if name.startswith(("drift", "turned")) else shared).append(columns)
    alone = np.split(np.hstack(own), ends)
    return (
        np.split(np.hstack(shared), ends),
        [part[:, np.abs(part).max(axis=0) > 0.0] for part in alone],
    )


def looked_at_stride(runs: Sequence[CalibrationRun]) -> int:
    """Every how many readings one is looked at."""
    # Of twice as many readings and more every second, third, ... one is looked at.
    return max(1, sum(map(len, runs)) // 24_000)


def _about(columns: Array, weight: Array) -> Array:
    """Columns about their weighted mean, by the roots of the weights; rounding is none of it."""
    about = columns - (weight @ columns) / weight.sum()
    is_rounding = np.abs(about).max(axis=0) <= 1e-9 * np.abs(columns).max(axis=0)
    return np.asarray(np.sqrt(weight)[:, None] * np.where(is_rounding, 0.0, about))


def _of_run(own: Array, index: int, runs: int) -> Array:
    """Columns that each run has for itself: those of this run, zeros for the others."""
    full = np.zeros((len(own), runs * own.shape[1]))
    full[:, index * own.shape[1] : (index + 1) * own.shape[1]] = own
    return full


def time_spline(time: Array, whole: Array, intervals: int) -> Array:
    """Cubic truncated powers over the run's time, without the constant, each of size about 1."""
    t = (time - whole[0]) / (whole[-1] - whole[0])
    knots = np.arange(1, intervals) / intervals
    powers = [2.0 * t - 1.0, (2.0 * t - 1.0) ** 2, (2.0 * t - 1.0) ** 3]
    return np.column_stack([*powers, *(np.maximum(0.0, t - k) ** 3 for k in knots)])
