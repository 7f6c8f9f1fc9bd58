"""``trueangle record``: readings as they arrive into a file of runs, until it is enough."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from .ending import put_off_ending
from .options import add_errors_in, add_runs_output, errors_in
from .signal_options import add_signals, signals_of_both
from .source_options import (
    SOURCES,
    add_source_options,
    source_argument,
    source_options,
)
from .values import seconds

HELP = "record readings as they arrive, and report when there are enough"
EXAMPLE = "trueangle record /dev/ttyUSB0 -o runs.csv --until orders"

#: Exit status where the source ended before it was asked to.
ENDED = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "sources",
        nargs="+",
        type=source_argument,
        metavar="SOURCE",
        help=f"{SOURCES}, or a file that grows; two, of the indicated angle and of the "
        "reference, are joined by the time of arrival",
    )
    add_runs_output(parser)
    add("--append", action="store_true", help="add a run to an output that is there")
    add("--label", metavar="NAME", help="label of the run (default: the next number)")
    add("--for", dest="seconds", type=seconds, metavar="60s", help="end after so long")
    add(
        "--until",
        choices=("orders", "coverage"),
        help="end when a turn has changed no order by more than its standard error, or when "
        "the whole turn has been read",
    )
    add("--rate", type=float, metavar="HZ", help="readings per second to keep, at most")
    add_source_options(parser)
    add_signals(parser, runs=False, topic=False, channels=False)
    add(
        "--progress",
        choices=("auto", "text", "json", "none"),
        default="auto",
        help="on stderr (default: a screen of text on a terminal)",
    )
    add_errors_in(parser)


def run(args: argparse.Namespace) -> int:
    """Record, print what was recorded."""
    from ..errors import ArgumentError
    from ..recording.output import RunsFile
    from ..recording.recording import Choices, record
    from ..recording.screen import Screen

    if args.rate is not None and not 0.0 < args.rate < math.inf:
        raise ArgumentError(f"--rate must be positive, got {args.rate!r}")
    choices = Choices(
        signals_of_both(args.signal),
        source_options(args),
        (args.counts_per_turn, args.counts_per_turn_reference),
        args.rate,
        math.inf if args.seconds is None else args.seconds,
        args.until,
    )
    screen = Screen(args.progress, errors_in(args))
    with put_off_ending() as stopped:
        file = RunsFile(Path(args.output), args.label, args.append)
        recording, ended = record(args.sources, file, choices, screen.show, stopped)
        print("\n".join(screen.summary(recording)), flush=True)
    return ENDED if ended == "source" else 0
