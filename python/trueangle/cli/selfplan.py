"""``trueangle plan --self METHOD``: arguments and words of a plan without a reference."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from .paths import Input

if TYPE_CHECKING:
    from ..planning.selfplan import SelfPlan

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
        from ..planning.selfdesigns import designed
        from ..simulation import load_simulation

        given = designed(load_simulation(args.simulation), args.self_method) | given
    plan = plan_self(args.self_method, **given)
    print(plan.to_json() if args.json else render(plan))
    return 0


def _angles(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or not all(map(math.isfinite, found)):
        raise ArgumentError(f"--angles: two angles or more in degrees, such as 0,90, got {text!r}")
    return found


def render(plan: SelfPlan) -> str:
    """The plan as text."""
    lines = [f"{plan.method}, without a reference"]
    if plan.angles_deg:
        lines.append(f"  angles                 {', '.join(f'{a:g}' for a in plan.angles_deg)} deg")
    if plan.speed_ratio is not None:
        table = ", ".join(f"{r:g}: {f:.2g}" for r, f in plan.speed_ratio_factors.items())
        lines += [
            f"  speed ratio            {plan.speed_ratio:g}",
            f"  factor by ratio        {table}",
            f"  knots per turn         at most {plan.knots_per_turn:g}, in the slowest part",
        ]
    lines.append(f"  worst noise factor     {plan.worst_noise_factor:.2f}")
    if plan.turns is not None:
        lines.append(f"  turns                  {plan.turns:.3g}")
    if plan.readings is not None:
        lines.append(f"  readings needed        {plan.readings}")
    if plan.seconds is not None:
        lines.append(f"  seconds                {plan.seconds:.3g}")
    if plan.given:
        given: Any = plan.given
        lines.append(
            f"  the given angles       factor {given['worst_noise_factor']:.2f}, "
            f"{given['worse_by']:.2f} times the best"
        )
        if given["blind_orders"]:
            names = ", ".join(f"{k:g}" for k in given["blind_orders"])
            lines.append(f"                         blind to {names}")
    entries = [f"{k:>5g} {f:5.2f}" for k, f in plan.noise_factors.items()]
    lines.append("  noise factor per order")
    lines += ["  " + "  ".join(entries[i : i + 6]) for i in range(0, len(entries), 6)]
    lines += [f"  note: {note}" for note in plan.notes]
    return "\n".join(lines)
