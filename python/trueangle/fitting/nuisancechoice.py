"""Choosing groups of nuisances by the error of folds held out, and fitting them with a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..estimation.linear import (
    NormalEquations,
    least_squares,
    left_out,
    linear_residual,
    pseudo_inverse,
)
from ..support.arrays import Array

#: Parts that are held out one by one.
FOLDS: Final = 3

#: A nuisance must lower the held-out sum of squares by this share, in most of the folds, ...
_GAIN: Final = 0.01


class FoldRows(NamedTuple):
    """Columns by name, each about its run's mean, the errors, and the fold of each reading."""

    pattern: Array
    groups: dict[str, Array]
    error: Array
    fold: NDArray[np.intp]


def _design(rows: FoldRows, chosen: Sequence[str]) -> Array:
    return np.hstack([rows.pattern, *(rows.groups[name] for name in chosen)])


def _held_out(rows: FoldRows, chosen: Sequence[str]) -> Array:
    """Sum of squares of each fold under the fit of the others."""
    design = _design(rows, chosen)
    masks = [rows.fold == f for f in range(FOLDS)]
    return left_out([NormalEquations.of_rows(design[m], rows.error[m]) for m in masks])[1]


def _told(rows: FoldRows, chosen: Sequence[str], name: str) -> float:
    """Part of a group's energy that the pattern and the chosen ones leave."""
    columns = rows.groups[name]
    return float((linear_residual(_design(rows, chosen), columns) ** 2).sum() / (columns**2).sum())


def choose_nuisance_groups(
    rows: FoldRows, forced: list[str]
) -> tuple[list[str], list[tuple[str, float]], list[str]]:
    """Groups taken one by one while the best lowers the held-out error."""
    chosen = list(forced)
    shares: list[tuple[str, float]] = []
    unseparated: list[str] = []
    before = _held_out(rows, chosen)
    total = float(before.sum())
    barred: set[str] = set()
    while True:
        trials = {
            name: _held_out(rows, [*chosen, name])
            for name in rows.groups
            if name not in chosen and name.rstrip("0123456789") not in barred
        }
        good = {
            name: after
            for name, after in trials.items()
            if after.sum() < (1.0 - _GAIN) * before.sum()
            and np.count_nonzero(after < before) > FOLDS // 2
        }
        if not good:
            return chosen, shares, unseparated
        least = min(float(after.sum()) for after in good.values())
        # A kinked drift imitates a ramp there and back: of equal ones the simplest.
        alike = [name for name, after in good.items() if after.sum() <= 1.02 * least]
        best = min(alike, key=lambda name: rows.groups[name].shape[1])
        kind = best.rstrip("0123456789")
        barred.add(kind)
        grown = max(error_inflation(rows, [*chosen, best]), default=1.0)
        # This share of it must remain next to the pattern, else they are not separable, and no
        # order's standard error may grow by more than this factor, else what the nuisance takes
        # away is the pattern.
        if _told(rows, chosen, best) < 0.02 or grown > 5.0:
            unseparated.append(kind)
            continue
        shares.append((kind, float(before.sum() - good[best].sum()) / total))
        chosen.append(best)
        before = good[best]


def reference_lines_help(rows: FoldRows) -> bool:
    """Whether lines of the reference in every run for itself lower the held-out error."""
    before, after = _held_out(rows, ["reference"]), _held_out(rows, ["turned"])
    lower = np.count_nonzero(after < before) > FOLDS // 2
    return bool(lower and after.sum() < (1.0 - _GAIN) * before.sum())


def best_spline(rows: FoldRows, chosen: Sequence[str]) -> str:
    """The spline that lowers the held-out error most."""
    names = [name for name in rows.groups if name.startswith("drift")]
    return min(names, key=lambda name: float(_held_out(rows, [*chosen, name]).sum()))


def error_inflation(rows: FoldRows, chosen: Sequence[str]) -> list[float]:
    """Standard errors of ``A, B`` of each order with the chosen groups, over those without them."""
    pattern, design = rows.pattern, _design(rows, chosen)
    size = pattern.shape[1]
    if not size:
        return []
    alone, beside = (pseudo_inverse(x.T @ x).diagonal()[:size] for x in (pattern, design))
    ratio = np.sqrt(np.maximum(beside / np.maximum(alone, 1e-300), 1.0))
    return [float(v) for v in ratio.reshape(2, -1).T.ravel()]


def solve_with_groups(rows: FoldRows, chosen: Sequence[str]) -> dict[str, Array]:
    """Coefficients of the chosen groups, fitted jointly with the pattern."""
    design = _design(rows, chosen)
    solution = least_squares(design, rows.error)
    ends = np.cumsum([rows.pattern.shape[1], *(rows.groups[n].shape[1] for n in chosen)])
    return dict(zip(chosen, np.split(solution, ends[:-1])[1:], strict=True))
