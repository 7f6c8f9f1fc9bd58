"""``trueangle join``: two logs with two clocks in, calibration runs out."""

from __future__ import annotations

import argparse
from functools import partial

from .options import add_shared, show
from .parser import Input, declare
from .signal_options import add_signals, signals_of_both

HELP = "join an indicated and a reference log with separate clocks"
EXAMPLE = "trueangle join joint.csv laser.csv -o runs.csv --signal b.reference='angle (rad)'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("first A", Input, "log of the indicated angle (or the reference)")
    add("second B", Input, "log of the other; both with their times")
    add_shared(parser, "runs-output")
    add(
        "--offset S",
        float,
        "seconds to add to the time of the indicated log to get that of the reference "
        "(default: from the motion; 0 for one clock)",
    )
    add("--rate PPM", float, "rate of the reference's clock against the other")
    add(
        "--max-gap S",
        float,
        "longest pause of the reference that is interpolated over "
        "(default: five times its typical step, and longer where it moves on a line)",
    )
    add_signals(parser, runs=False, channels=False)
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Join, write, print."""
    from ..runs.joining import join

    found = join(
        args.first,
        args.second,
        offset_s=args.offset,
        rate_ppm=args.rate,
        max_gap_s=args.max_gap,
        counts_per_turn=args.counts_per_turn,
        counts_per_turn_reference=args.counts_per_turn_reference,
        signals=signals_of_both(args.signal),
        topic=args.topic,
    )
    found.save(args.output)
    show(args, found, args.output, named="output")
    return 0
