"""The evidence of a cause where the zeros of the runs scatter by more than the noise explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..effects import EFFECTS
from ..estimation.regression import Regression
from ..support.arrays import Array
from ..support.distributions import f_tail
from .candidates import propose_candidates
from .goodness import Unexplained
from .goodness.zeros import ZEROS
from .penalty import NEW_CAUSE, regression_without
from .selection import acts_on_runs

#: Probability above which the scatter of unexplained zeros may as well have made a cause.
CHANCE = 0.01


def chance_between_runs(
    regression: Regression, group: Sequence[int], unexplained: Unexplained
) -> float:
    """Probability that the scatter of the runs' zeros makes what a finding explains between runs.

    0 where they do not scatter, and where readings within the runs show the cause; else that of
    `scatter_chance` times the number of laws that could have been chosen instead. 1 where no run
    remains to show whether they scatter.
    """
    scatter = zeros_scatter(unexplained)
    if not (scatter or _has_no_run_to_spare(regression)):
        return 0.0
    if not group or any(regression.terms[k].columns.size == 0 for k in group):
        return 0.0
    own = np.hstack([regression.terms[k].columns for k in group])
    runs = _numbered(regression)
    zeros = (runs[:, None] == np.arange(1, int(runs.max()) + 1)).astype(np.float64)
    rest = regression_without(regression, group, settled=True)
    within, _ = rest.jointly_with(zeros).gain(own)
    if within > NEW_CAUSE + own.shape[1] * float(np.log(regression.n)):
        return 0.0
    if not scatter:
        return 1.0 if _freedom(regression, group) < 1 else 0.0
    laws = (propose_candidates(EFFECTS[cause], rest) for cause in acts_on_runs())
    tried = sum(law is not None and law.bic_gain > NEW_CAUSE for law in laws)
    return min(1.0, scatter_chance(regression, group) * max(tried, 1))


def zeros_scatter(unexplained: Unexplained) -> bool:
    """The zeros of the runs differ by more than the noise, and nothing explains it."""
    return any(item.test == ZEROS and item.p < CHANCE for item in unexplained.evidence)


def _has_no_run_to_spare(regression: Regression) -> bool:
    """As many coefficients as there are differences between the runs may explain these."""
    columns = sum(term.columns.shape[1] for term in regression.terms)
    return bool(regression.signals.runs - 1 <= columns)


def scatter_chance(regression: Regression, group: Sequence[int]) -> float:
    """Probability that as much of the runs' means is explained by their residual scatter alone.

    ::

        m_j = a + Σ_i b_i x̄_ij + u_j,   F = (Δ Σ n_j u_j² / k) / (Σ n_j u_j² / ν)

    m_j are the means of the runs less the lines, x̄_ij those of the terms that change from
    run to run, ν the runs less the coefficients. For a cause that changes only from run to run all
    readings of a run count as one: a delay uses up one of four runs.
    """
    without, told, count = _between(regression, group)
    extra, freedom = told.rank - without.rank, count - told.rank
    if extra < 1 or freedom < 1:
        return 1.0
    before, after = float(without.squares[0]), float(told.squares[0])
    f = (before - after) / extra / max(after / freedom, 1e-300)
    return f_tail(f, extra, freedom)


def _freedom(regression: Regression, group: Sequence[int]) -> int:
    """Runs beyond the coefficients of their means."""
    _, told, count = _between(regression, group)
    return count - told.rank


def _between(
    regression: Regression, group: Sequence[int]
) -> tuple[_core.LinearModel, _core.LinearModel, int]:
    """Means of the runs without a finding and with it, and how many they are."""
    runs = _numbered(regression)
    fitted = regression.fitted()
    explained = [fitted[k][0].columns @ fitted[k][1] for k in group]
    others = [
        term.columns[:, _mostly_between(term.columns, runs)]
        for k, term in enumerate(regression.terms)
        if k not in group and term.run_effect is None
    ]
    target, own, beside = (
        _weighted_means(columns, runs)
        for columns in (
            (regression.left + np.sum(explained, axis=0))[:, None],
            np.hstack([regression.terms[k].columns for k in group]),
            np.hstack([np.ones((regression.n, 1)), *others]),
        )
    )
    without = _core.LinearModel.of_rows(beside, target)
    return without, _core.LinearModel.of_rows(np.hstack([beside, own]), target), len(target)


def _numbered(regression: Regression) -> NDArray[np.int64]:
    """The run of every reading, counted from 0."""
    return np.unique(regression.signals.run, return_inverse=True)[1]


def _weighted_means(columns: Array, runs: NDArray[np.int64]) -> Array:
    """Means of every run times the root of its readings."""
    count = np.bincount(runs)
    sums = [np.bincount(runs, column) for column in columns.T]
    return np.stack(sums, axis=1) / np.sqrt(count)[:, None]


def _mostly_between(columns: Array, runs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Columns that change from run to run more than within: not lines, for example."""
    between = np.sum(_weighted_means(columns - columns.mean(axis=0), runs) ** 2, axis=0)
    return np.asarray(between > 0.5 * len(columns) * np.var(columns, axis=0))
