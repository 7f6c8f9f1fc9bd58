"""Causes in rounded readings: those that the rounding itself would imitate are rejected.

On the same positions a sensor that rounds has the same error in every run, by up to half a step.
This error has orders, follows the direction, and has a period in time. So the chosen causes are
tested again against the steps of the readings (`trueangle.estimation.rounded`), the strongest
first; and the residual is compared with noise as it was before it was rounded.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..estimation.factor import orthonormal_basis
from ..estimation.regression import Extension, Regression
from ..estimation.rounded import Rounded, fit_rounded, is_rounding_visible
from ..estimation.whitening import RunEffect
from ..support.arrays import Array
from .penalty import NEW_CAUSE, finding_groups


def rounding_of(regression: Regression) -> float:
    """Standard deviation of the rounding where it is a good part of the residual, else 0."""
    readings, left = regression.readings, regression.variance
    is_part = is_rounding_visible(readings.rounding**2, left, readings.scatter**2)
    return readings.rounding if is_part and not regression.is_explained else 0.0


def account_beyond_rounding(start: Regression, chosen: Regression) -> Regression:
    """The account with those of its causes that the rounding of the readings does not make.

    Parameters
    ----------
    start : Regression
        The readings without any cause.
    chosen : Regression
        The causes chosen as if no reading had been rounded.
    """
    if not chosen.terms or not rounding_of(chosen):
        return chosen
    paths = [term for term in chosen.terms if _is_path(term)]
    groups = [[chosen.terms[k] for k in group] for group in finding_groups(chosen.terms)]
    groups = [group for group in groups if not _is_path(group[0])]
    told: list[Extension] = []
    fit = _fit(start, told, chosen.outlying)
    while groups and not fit.within:
        tried = [_fit(start, [*told, *group], chosen.outlying) for group in groups]
        gains = [
            2.0 * (other.log_likelihood - fit.log_likelihood) - _penalty(group, start)
            for other, group in zip(tried, groups, strict=True)
        ]
        best = int(np.argmax(gains))
        if gains[best] < NEW_CAUSE:
            break
        told += groups.pop(best)
        fit = tried[best]
    if not (groups or paths):
        return chosen
    account = start.with_terms(told)
    for path in paths:
        # One that follows anything has no size in each run that could be fitted to steps.
        drawn = path.run_effect
        if drawn is None or _gain_of_path(unrounded(account), path, drawn) > NEW_CAUSE:
            account = start.with_terms([*account.terms, path])
    return account


def _is_path(term: Extension) -> bool:
    return EFFECTS[term.cause].describes_noise(term)


def _gain_of_path(regression: Regression, path: Extension, drawn: RunEffect) -> float:
    asked = (path.cause, path.shape, drawn.columns, path.log_grid)
    return regression.propose_run_effect(*asked).bic_gain


def is_rounding_only(regression: Regression) -> bool:
    """Every reading is what was fitted, rounded."""
    if not rounding_of(regression):
        return False
    return _fit(regression, regression.terms, regression.outlying).within


def unrounded(regression: Regression) -> Regression:
    """The same account of errors as they may have been before they were rounded (seed 0)."""
    if not rounding_of(regression):
        return regression
    fit = _fit(regression, regression.terms, regression.outlying)
    error = np.where(regression.outlying, fit.left, fit.drawn(np.random.default_rng(0)))
    readings = regression.readings.less(fit.left - error)
    found = regression.of_readings(readings, cache=regression.cache.for_other_errors())
    return found.with_terms(regression.terms)


def _fit(start: Regression, terms: Sequence[Extension], outlying: NDArray[np.bool_]) -> Rounded:
    """Terms fitted to the steps of the readings; what is new in every run has a size in each."""
    drawn = [term.run_effect.columns for term in terms if term.run_effect is not None]
    own = [_of_each_run(columns, start.bounds) for columns in drawn]
    columns = np.hstack([start.base, *(term.columns for term in terms), *own])
    basis = orthonormal_basis(columns)
    return fit_rounded(basis, start.residual, start.signals.count, outlying)


def _of_each_run(columns: Array, bounds: Sequence[tuple[int, int]]) -> Array:
    found = np.zeros((len(columns), len(bounds), columns.shape[1]))
    for k, (start, stop) in enumerate(bounds):
        found[start:stop, k] = columns[start:stop]
    return found.reshape(len(columns), -1)


def _penalty(group: Sequence[Extension], start: Regression) -> float:
    """What the terms of one finding must bring: with a size in each run of what these draw."""
    penalty = 0.0
    for term in group:
        own = 0 if term.run_effect is None else term.run_effect.columns.shape[1] * len(start.bounds)
        penalty += max(term.parameters, own) * term.log_n + 2.0 * term.log_grid
    return penalty
