"""Runs named on the command line."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import ArgumentError
from ..runfiles import read_runs
from ..runs import CalibrationRun
from .parser import did_you_mean

__all__ = ["listed", "read_selected"]


def read_selected(
    paths: Sequence[str], counts_per_turn: float | None, labels: Sequence[str] | None
) -> list[CalibrationRun]:
    """Runs of the files, those of ``labels`` only where labels are given.

    Raises
    ------
    ArgumentError
        A label that no run has; names those there are.
    """
    runs = read_runs(paths, counts_per_turn=counts_per_turn)
    if not labels:
        return runs
    known = list(dict.fromkeys(run.label for run in runs if run.label is not None))
    missing = [label for label in labels if label not in known]
    if missing and not known:
        raise ArgumentError(
            f"--run {missing[0]}: the files name no runs (there is no column 'run'): "
            "leave --run out, or add the column"
        )
    if missing:
        raise ArgumentError(
            f"--run {missing[0]}: no such run{did_you_mean(missing[0], known)}; "
            f"the runs are {listed(known)}"
        )
    return [run for run in runs if run.label in labels]


def listed(names: Sequence[str], most: int = 12) -> str:
    """The first names, and how many more there are.

    Examples
    --------
    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")
