"""``trueangle plan --self METHOD``: arguments and words of a plan without a reference."""

from __future__ import annotations

import argparse
import math

from ..errors import ArgumentError
from .paths import Input

__all__ = ["add_self_arguments", "run_self"]


def add_self_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of ``--self``."""
    from ..planning.selfplan import SELF_METHODS

    add = parser.add_argument_group("without a reference").add_argument
    add(
        "--self",
        dest="self_method",
        choices=SELF_METHODS,
        metavar="METHOD",
        help=f"plan a calibration without a reference: {', '.join(SELF_METHODS)}",
    )
    add(
        "--simulation",
        type=Input,
        metavar="FILE",
        help="simulation file whose heads, shifts, coast and noise are planned with",
    )
    add("--count", type=int, metavar="N", help="heads or shifts (default: 3)")
    add("--angles", metavar="0,90,180", help="angles of heads or shifts that are there")
    add("--speed-ratio", type=float, metavar="R", help="start over end speed (5)")
    add("--start-speed", type=float, metavar="F", help="turns per second at the start")
    add("--rate", type=float, metavar="HZ", help="readings per second")


def run_self(args: argparse.Namespace, orders: tuple[float, ...] | None) -> int:
    """Print the plan."""
    from ..planning.selfplan import plan_self

    told = {
        "orders": orders,
        "count": args.count,
        "angles": None if args.angles is None else _angles(args.angles),
        "speed_ratio": args.speed_ratio,
        "start_speed": args.start_speed,
        "rate": args.rate,
        "gear_ratio": args.gear_ratio,
        "noise": args.noise_arcsec,
        "standard_error": args.std_arcsec,
    }
    given = {name: value for name, value in told.items() if value is not None}
    if args.simulation is not None:
        from ..planning.selfdesigns import designed_selfplan
        from ..simulation import load_simulation

        given = designed_selfplan(load_simulation(args.simulation), args.self_method) | given
    plan = plan_self(args.self_method, **given)
    print(plan.to_json() if args.json else plan.summary())
    return 0


def _angles(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or not all(map(math.isfinite, found)):
        raise ArgumentError(f"--angles: two angles or more in degrees, such as 0,90, got {text!r}")
    return found
