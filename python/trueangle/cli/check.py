"""``trueangle check``: are data fit to be used before anything is fitted."""

from __future__ import annotations

import argparse

from .paths import Input
from .signal_options import add_signals, reading

HELP = "say whether data are fit to be used, and what they can tell, before anything is fitted"
EXAMPLE = "trueangle check runs.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("files", nargs="+", type=Input, metavar="FILES", help="calibration runs of any format")
    add_signals(parser)
    add("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the check; 1 where a fault makes the data unusable."""
    from ..runs.checks import check

    found = check(args.files, **reading(args))
    print(found.to_json() if args.json else found.summary())
    return 0 if found.usable else 1
