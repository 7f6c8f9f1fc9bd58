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


def read_selected_runs(args: argparse.Namespace) -> list[CalibrationRun]:
    """Runs of a command's files, those of ``--run`` only where labels or patterns are given.

    Faults of their data are reported on stderr, in the words of ``check``.

    Raises
    ------
    ArgumentError
        A label that no run has; names those there are.
    """
    from ..runs.checks.check import data_faults
    from ..runs.checks.record import records_of

    runs = _selected(read_runs(args.runs, **reading_options(args)), getattr(args, "run", None))
    for fault in data_faults(records_of(runs)):
        told = of_joint(str(fault), getattr(args, "of_joint", None))
        print(f"trueangle: warning: {told}", file=sys.stderr)
    return runs


def _selected(runs: list[CalibrationRun], patterns: list[str] | None) -> list[CalibrationRun]:
    if not patterns:
        return runs
    known = list(dict.fromkeys(run.label for run in runs if run.label is not None))
    found = {p: {name for name in known if _is_meant(name, p.removeprefix("!"))} for p in patterns}
    missing = next((pattern for pattern in patterns if not found[pattern]), None)
    if missing is not None and not known:
        raise ArgumentError(
            f"--run {missing}: the files name no runs (there is no column 'run'): "
            "leave --run out, or name the column of their labels with --signal run=NAME"
        )
    if missing is not None:
        raise ArgumentError(
            f"--run {missing}: no such run; the runs are "
            f"{listed_names(known)}{did_you_mean(missing.removeprefix('!'), known)}"
        )
    omitted = {name for p in patterns if p.startswith("!") for name in found[p]}
    wanted = {name for p in patterns if not p.startswith("!") for name in found[p]} or {*known}
    return [run for run in runs if run.label in wanted - omitted]


def _is_meant(name: str, label: str) -> bool:
    """Whether ``label`` is a name or a pattern (``fwd-*``) that matches it."""
    return name == label or fnmatchcase(name, label)
