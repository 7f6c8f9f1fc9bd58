"""The unit of errors in what commands print."""

from __future__ import annotations

import argparse

from ..support.display_units import ERROR_UNITS, ErrorsIn

__all__ = ["add_errors_in", "errors_in"]


def add_errors_in(parser: argparse.ArgumentParser) -> None:
    """Declare ``--errors-in``; shared by every command that prints errors."""
    parser.add_argument(
        "--errors-in",
        choices=ERROR_UNITS,
        default="auto",
        help="unit of errors in what is printed for people (default: arcsec, or deg where "
        "errors are that large; JSON is in arcsec always)",
    )


def errors_in(args: argparse.Namespace) -> ErrorsIn:
    """What a summary takes: the name, or the counts of a turn where they are given."""
    counts: float | None = getattr(args, "counts_per_turn", None)
    if args.errors_in == "count" and counts is not None:
        return counts
    return str(args.errors_in)
