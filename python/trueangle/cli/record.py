"""``trueangle record``: readings as they arrive into a file of runs, until it is enough."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from ..support.layout import counted
from .ending import put_off_ending
from .options import add_errors_in, add_runs_output, errors_in
from .signal_options import add_signals, signals_of_both
from .source_options import (
    SOURCES,
    add_source_options,
    sent_text,
    source_argument,
    source_options,
)
from .values import seconds

if TYPE_CHECKING:
    from ..recording.record import Recorded

HELP = "record readings as they arrive, and report when there are enough"
EXAMPLE = (
    "trueangle record /dev/ttyUSB0 -o runs.csv --until orders --signal indicated=raw:count "
    "--counts-per-turn 4096 --signal reference=step:count --counts-per-turn-reference 3200"
)

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
    add_signals(parser, runs=False, topic=False)
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
    from ..recording.columns import Counts
    from ..recording.record import Choices, record
    from ..recording.screen import Screen

    if args.rate is not None and not 0.0 < args.rate < math.inf:
        raise ArgumentError(f"--rate must be positive, got {args.rate!r}")
    choices = Choices(
        signals_of_both(args.signal),
        Counts(args.counts_per_turn, args.counts_per_turn_reference),
        source_options(args),
        args.pattern,
        args.label,
        sent_text(args),
        args.append,
        args.rate,
        args.seconds,
        args.until,
    )
    screen = Screen(args.progress, errors_in(args))
    with put_off_ending() as stopped:
        found = record(args.sources, args.output, choices, screen, stopped)
        print(_told(found, args), flush=True)
    return ENDED if found.ended == "source" else 0


def _told(found: Recorded, args: argparse.Namespace) -> str:
    """What was recorded, in a few lines."""
    from ..support.angles import arcsec
    from ..support.display_units import error_unit

    recording, file = found.recording, found.recording.file
    rejected = file.rejected.lines
    kept = f" ({file.rejected.path})" if rejected else ""
    lines = [
        f"{args.output}: {counted(recording.rows, 'reading')} in run {file.label}, "
        f"{counted(rejected, 'line')} rejected{kept}"
    ]
    if recording.unpaired:
        lines.append(f"{counted(recording.unpaired, 'reading')} without a reference at their time")
    for address, arrival in zip(args.sources, recording.arrivals, strict=True):
        if arrival.layout is not None:
            lines.append(
                f"{address}: {arrival.layout.kind}, columns {', '.join(arrival.layout.names)}"
            )
        if arrival.problem is not None:
            lines.append(f"{address}: ended by a fault: {arrival.problem}")
    if recording.is_stamped and recording.rows > 1:
        lines.append(f"times are those of arrival, jitter {1e3 * recording.jitter:.2g} ms")
    scale = arcsec(1.0, recording.period)
    for order in recording.estimate.orders[:8] if recording.estimate else ():
        size, std = scale * order.amplitude, scale * order.std
        lines.append(f"order {order.order:3d}  {error_unit(errors_in(args), size).text(size, std)}")
    lines += [f"{name}: {says}" for name, says in recording.faults.items()]
    lines.append(f"missing: {recording.missing or 'nothing'}")
    return "\n".join(lines)
