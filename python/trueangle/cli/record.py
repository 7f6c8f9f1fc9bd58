"""``trueangle record``: readings as they arrive into a file of runs, until it is enough."""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path

from ..support.deadline import put_off_ending
from .options import add_shared, errors_in
from .parser import declare
from .signal_options import (
    SOURCES,
    add_signals,
    add_source_options,
    signals_of_both,
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
    add = partial(declare, parser)
    add(
        "sources SOURCE...",
        source_argument,
        f"{SOURCES}, or a file that grows; two, of the indicated angle and of the "
        "reference, are joined by the time of arrival",
    )
    add_shared(parser, "runs-output")
    add("--append", bool, "add a run to an existing output")
    add("--label NAME", str, "label of the run (default: the next number)")
    add("--for 60s", seconds, "end after this time", dest="seconds")
    add(
        "--until",
        ("orders", "coverage"),
        "end when a turn has changed no order by more than its standard error, or when "
        "the whole turn has been read",
    )
    add("--rate HZ", float, "readings per second to keep, at most")
    add_source_options(parser)
    add_signals(parser, runs=False, topic=False, channels=False)
    add(
        "--progress",
        ("auto", "text", "json", "none"),
        "progress on stderr (default: a screen of text on a terminal)",
        default="auto",
    )
    add_shared(parser, "errors-in")


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
        source_options(args, args.sources),
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
