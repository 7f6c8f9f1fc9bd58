"""Runs named on the command line."""

from __future__ import annotations

import argparse
import sys
from fnmatch import fnmatchcase

from ..errors import ArgumentError
from ..runs.files import read_runs
from ..runs.run import CalibrationRun
from ..support.suggestions import did_you_mean, listed_names
from .signal_options import of_joint, reading_options

__all__ = ["listed_names", "read_selected_runs"]


def read_selected_runs(args: argparse.Namespace) -> list[CalibrationRun]:
    """Runs of a command's files, those of ``--run`` only where labels or patterns are given.

    Raises
    ------
    ArgumentError
        A label that no run has; names those there are.
    """
    runs = read_checked_runs(args)
    labels: list[str] = args.run or []
    if not labels:
        return runs
    known = list(dict.fromkeys(run.label for run in runs if run.label is not None))
    found = {label: [name for name in known if _is_meant(name, label)] for label in labels}
    missing = [label for label in labels if not found[label]]
    if missing and not known:
        raise ArgumentError(
            f"--run {missing[0]}: the files name no runs (there is no column 'run'): "
            "leave --run out, or name the column of their labels with --signal run=NAME"
        )
    if missing:
        raise ArgumentError(
            f"--run {missing[0]}: no such run; the runs are "
            f"{listed_names(known)}{did_you_mean(missing[0], known)}"
        )
    chosen = {name for names in found.values() for name in names}
    return [run for run in runs if run.label in chosen]


def _is_meant(name: str, label: str) -> bool:
    """Whether ``label`` is a name or a pattern (``fwd-*``) that matches it."""
    return name == label or fnmatchcase(name, label)


def read_checked_runs(args: argparse.Namespace) -> list[CalibrationRun]:
    """Runs of the files; faults of the data are reported on stderr, in the words of ``check``."""
    from ..runs.checks.check import data_faults
    from ..runs.checks.record import records_of

    runs = read_runs(args.runs, **reading_options(args))
    for fault in data_faults(records_of(runs)):
        told = of_joint(str(fault), getattr(args, "of_joint", None))
        print(f"trueangle: warning: {told}", file=sys.stderr)
    return runs
