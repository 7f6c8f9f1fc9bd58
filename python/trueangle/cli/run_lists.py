"""Runs named on the command line."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

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

    runs = read_runs(_files(args.runs), **reading(args))
    for fault in faults_of(records_of(runs)):
        print(f"trueangle: warning: {fault}", file=sys.stderr)
    return runs


def _files(paths: Sequence[str]) -> Sequence[str | Path]:
    """The files, those in folders included."""
    if not any(map(os.path.isdir, paths)):
        return paths
    from ..logs.sources import find_logs

    found: list[str | Path] = []
    for path in paths:
        found += [log for log, _ in find_logs([path])] if os.path.isdir(path) else [path]
    return found
