"""Runs named on the command line."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import ArgumentError
from ..runfiles import read_runs
from ..runs import CalibrationRun

__all__ = ["read_selected"]


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
    known = [str(run.label) for run in runs]
    missing = [label for label in labels if label not in known]
    if missing:
        raise ArgumentError(f"--run {missing[0]}: no such run; the runs are {', '.join(known)}")
    return [run for run in runs if str(run.label) in labels]
