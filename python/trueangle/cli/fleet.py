"""``trueangle fleet``: units of one design against each other, and against months ago."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from ..support.files import FLEET
from .options import add_joint, add_shared, show
from .parser import Input, Output, declare
from .signal_options import reading_options
from .values import declared_shafts, orders_by_shaft

if TYPE_CHECKING:
    from ..fleets.result import Fleet

HELP = "find outliers of a fleet, the pattern that its units share, and units that changed"
EXAMPLE = "trueangle fleet spring/ autumn/ -o fleet.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("runs RUNS...", Input, "files or folders of readings")
    add(
        "--by",
        ("unit", "run"),
        "what identifies a unit (default: the column unit; without one, the runs)",
        default="unit",
    )
    add("--orders 1-4", str, "orders compared (default: those above the noise)")
    add(
        "--share P",
        float,
        "share of the units within the tolerance limits (default: %(default)s)",
        default=0.95,
    )
    add("--confidence G", float, "confidence of these limits (default: %(default)s)", default=0.95)
    add(
        "--permitted-arcsec E",
        float,
        "largest permitted error: gives the day of the next calibration",
    )
    add_joint(parser)
    add(
        "-o --output FLEET",
        Output.of(FLEET),
        "fleet file to write: a prior for further units (fit --prior)",
    )
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")


def _orders(text: str, shafts: dict[str, float]) -> Any:
    orders = orders_by_shaft(text, shafts)
    return None if isinstance(orders, str) else orders


def requested_fleet(args: argparse.Namespace, **limits: Any) -> Fleet:
    """The fleet of the runs that are requested."""
    from ..fleets.fleet import fleet

    shafts = declared_shafts(args.shaft)
    return fleet(
        args.runs,
        args.by,
        orders=None if args.orders is None else _orders(args.orders, shafts),
        gear_ratio=args.gear_ratio,
        fixed_member=args.fixed_member,
        shafts=shafts,
        **limits,
        **reading_options(args),
    )


def run(args: argparse.Namespace) -> int:
    """Judge the units, save, print."""
    found = requested_fleet(
        args, share=args.share, confidence=args.confidence, permitted_arcsec=args.permitted_arcsec
    )
    if args.output is not None:
        found.save(args.output)
    show(args, found, args.output)
    return 0
