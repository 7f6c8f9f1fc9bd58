"""Logs of any size behind a command: what is read into runs, and what is summed in one pass."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any, Final

from ..errors import ArgumentError
from .ending import own_interrupts
from .parser import declare
from .signal_options import reading_options
from .values import declared_shafts

#: Readings, two numbers of 8 bytes each, that are read into runs: 256 MiB of them.
_READINGS: Final = (256 << 20) // 16


def add_one_pass(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of fits in one pass."""
    add = partial(declare, parser)
    add(
        "--one-pass",
        bool,
        "constant memory: sums of all readings and some 65 000 of them as they are, where "
        "there are more than 2^20; so by itself for more than 2^24, and with a --scheduler",
    )
    add(
        "--scheduler tcp://HOST:PORT",
        str,
        "Dask scheduler whose workers share the files: a log on each",
    )
    add(
        "--progress",
        ("auto", "text", "json", "none"),
        "of a fit in one pass, on stderr (default: text on a terminal)",
        default="auto",
    )


def wants_one_pass(args: argparse.Namespace) -> bool:
    """Whether the readings must or should not all be in memory.

    Raises
    ------
    ArgumentError
        An option that needs all readings.
    """
    asked = bool(args.one_pass or args.scheduler) or _is_large(args)
    if asked and (args.nuisance != "none" or args.reference_orders):
        raise ArgumentError(
            "--nuisance and --reference-orders need all readings: they do not go with logs in "
            "one pass"
        )
    if asked and (args.run or getattr(args, "loss", "auto") not in ("auto", "linear")):
        raise ArgumentError(
            "--run and the losses huber and tukey need all readings: they do not go with logs in "
            "one pass"
        )
    return asked


def refuse_robot(args: argparse.Namespace) -> None:
    """Refuse one pass over the logs of several joints.

    Raises
    ------
    ArgumentError
        It was asked for.
    """
    if args.one_pass or args.scheduler:
        raise ArgumentError("--one-pass and --scheduler go with one joint: leave --robot out")


def _is_large(args: argparse.Namespace) -> bool:
    from ..runs.paths import find_logs, matched_paths

    paths = matched_paths(args.runs)
    if not all(path.is_file() or path.is_dir() for path in paths):
        return False  # a pipe is read once
    from ..logs.sources import logs_hold_at_most

    found = [path for path, _ in find_logs(paths)]
    return not logs_hold_at_most(found, _READINGS, args.topic)


def log_options(args: argparse.Namespace) -> dict[str, Any]:
    """Keywords of `trueangle.fit_logs` from the options of a command."""
    own_interrupts()
    reading = reading_options(args)
    if reading.pop("periods_per_turn") is not None:
        raise ArgumentError(
            "--periods-per-turn is for sine and cosine channels, which need all readings: leave "
            "--one-pass out"
        )
    return {
        "gear_ratio": args.gear_ratio,
        "fixed_member": args.fixed_member,
        "argument": args.argument,
        "covariance": args.covariance,
        **reading,
        "shafts": declared_shafts(args.shaft),
        "scheduler": args.scheduler,
        "progress": args.progress,
    }
