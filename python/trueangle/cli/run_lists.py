"""Runs named on the command line."""

from __future__ import annotations

import argparse
import sys

from ..errors import ArgumentError
from ..runs.files import read_runs
from ..runs.run import CalibrationRun
from ..support.suggestions import did_you_mean, listed
from .signal_options import reading

__all__ = ["listed", "read_selected"]


def read_selected(args: argparse.Namespace) -> list[CalibrationRun]:
    """Runs of a command's files, those of ``--run`` only where labels are given.

    Raises
    ------
    ArgumentError
        A label that no run has; names those there are.
    """
    runs = read_checked(args)
    labels: list[str] = args.run or []
    if not labels:
        return runs
    known = list(dict.fromkeys(run.label for run in runs if run.label is not None))
    missing = [label for label in labels if label not in known]
    if missing and not known:
        raise ArgumentError(
            f"--run {missing[0]}: the files name no runs (there is no column 'run'): "
            "leave --run out, or name the column of their labels with --signal run=NAME"
        )
    if missing:
        raise ArgumentError(
            f"--run {missing[0]}: no such run{did_you_mean(missing[0], known)}; "
            f"the runs are {listed(known)}"
        )
    return [run for run in runs if run.label in labels]


def read_checked(args: argparse.Namespace) -> list[CalibrationRun]:
    """Runs of the files; faults of the data are told on stderr, in the words of ``check``."""
    from ..runs.checks.check import faults_of
    from ..runs.checks.record import records_of

    runs = read_runs(args.runs, **reading(args))
    for fault in faults_of(records_of(runs)):
        print(f"trueangle: warning: {fault}", file=sys.stderr)
    return runs
