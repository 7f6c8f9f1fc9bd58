"""``trueangle plan``: positions that keep the wanted orders apart."""

from __future__ import annotations

import argparse
import math

from ..errors import ArgumentError
from .nextplan import add_after_arguments, refuse_without_after, run_after
from .paths import Input
from .selfplan import add_self_arguments, run_self

HELP = "propose calibration positions that keep the wanted orders apart"
#: Degrees over which an uncertainty is wanted where no arc is stated.
WHOLE_TURN = (0.0, 360.0)

EXAMPLE = "trueangle plan --gear-ratio 100 --positions 36 --mounts 2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("--gear-ratio", type=float, metavar="R", help="motor turns per output turn")
    add(
        "--fixed-member",
        choices=("circular_spline", "flexspline", "none"),
        default="circular_spline",
        help="the member of the gear that stands still (default: %(default)s)",
    )
    add("--positions", type=int, metavar="N", help="positions per mount (default: 36)")
    add("--mounts", type=int, metavar="J", help="mounts of the artefact (default: 2)")
    add(
        "--reference",
        choices=("polygon", "off-null", "encoder"),
        default="polygon",
        help="polygon: remount it; off-null: read the autocollimator at tilts instead; "
        "encoder: a free reference encoder (default: %(default)s)",
    )
    add(
        "--tilt-arcsec",
        type=float,
        default=1200.0,
        metavar="U",
        help="off-null: largest tilt to both sides (default: %(default)g)",
    )
    add("--tilts", type=int, default=2, metavar="T", help="off-null: tilts per facet (default: 2)")
    add("--orders", metavar="1-17,202", help="orders wanted (default: 1-17 and the gear's own)")
    add("--noise-arcsec", type=float, metavar="S", help="scatter of one reading")
    add("--std-arcsec", type=float, metavar="U", help="standard error wanted: gives the readings")
    arc = parser.add_argument_group("a joint that cannot turn once")
    arc.add_argument(
        "--arc",
        type=_arc,
        metavar="START:STOP",
        help="degrees; where to read on this arc (--arc=-135:135 where it starts below zero)",
    )
    arc.add_argument("--readings", type=int, metavar="N", help="readings to spend (default: 60)")
    arc.add_argument(
        "--runs", type=int, metavar="R", help="runs, each with a zero of its own (default: 1)"
    )
    arc.add_argument(
        "--both-directions", action="store_true", help="read every place from either side"
    )
    arc.add_argument(
        "--apart", type=float, metavar="DEG", help="least distance of two places (default: none)"
    )
    arc.add_argument(
        "--uncertainty",
        type=_angle,
        metavar="U",
        help="wanted at every place (k = 2), such as 2arcsec or 0.01deg: gives the readings "
        "(without --arc, over the whole turn)",
    )
    arc.add_argument(
        "--prior",
        type=Input,
        metavar="FLEET.json",
        help="a unit like those of this fleet: how few readings are enough for --uncertainty, or "
        "what --readings are enough for",
    )
    add("--json", action="store_true", help="print the plan as JSON")
    add_after_arguments(parser)
    add_self_arguments(parser)


def _arc(text: str) -> tuple[float, float]:
    """``START:STOP`` in degrees."""
    start, colon, stop = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return float(start), float(stop)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an arc: START:STOP in degrees, such as 0:270"
        ) from None


def _angle(text: str) -> float:
    """An angle in arcsec; ``arcsec``, ``arcmin``, ``deg`` or ``mrad`` may follow."""
    for unit, arcsec in _ARCSEC.items():
        if text.endswith(unit):
            number, scale = text.removesuffix(unit), arcsec
            break
    else:
        number, scale = text, 1.0
    try:
        return float(number) * scale
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an angle: a number and {', '.join(_ARCSEC)}, such as 2arcsec"
        ) from None


_ARCSEC = {"arcsec": 1.0, "arcmin": 60.0, "mrad": 648.0 / math.pi, "deg": 3600.0}


def _run_arc(args: argparse.Namespace, orders: tuple[float, ...] | None) -> int:
    from ..planning.arc import plan_arc

    start, stop = WHOLE_TURN if args.arc is None else args.arc
    plan = plan_arc(
        start,
        stop,
        orders,
        readings=args.readings,
        runs=1 if args.runs is None else args.runs,
        both_directions=args.both_directions,
        apart=0.0 if args.apart is None else args.apart,
        noise=args.noise_arcsec,
        standard_error=args.std_arcsec,
        uncertainty=args.uncertainty,
    )
    print(plan.to_json() if args.json else plan.summary())
    return 0


def _run_unit(args: argparse.Namespace, orders: tuple[float, ...] | None) -> int:
    from ..fleets import load_fleet, plan_unit

    given = {
        "--runs": args.runs,
        "--both-directions": args.both_directions or None,
        "--apart": args.apart,
        "--std-arcsec": args.std_arcsec,
    }
    for option, value in given.items():
        if value is not None:
            raise ArgumentError(f"{option} does not go with --prior; leave one of them out")
    if (args.uncertainty is None) == (args.readings is None):
        raise ArgumentError(
            "--prior needs what the readings are for, --uncertainty 2arcsec, or how many there "
            "are, --readings N; one of them"
        )
    start, stop = WHOLE_TURN if args.arc is None else args.arc
    plan = plan_unit(
        load_fleet(args.prior),
        start,
        stop,
        orders,
        uncertainty=args.uncertainty,
        readings=args.readings,
        noise=args.noise_arcsec,
    )
    print(plan.to_json() if args.json else plan.summary())
    return 0


def _refuse_without_arc(args: argparse.Namespace) -> None:
    given = {
        "--readings": args.readings,
        "--runs": args.runs,
        "--both-directions": args.both_directions or None,
        "--apart": args.apart,
    }
    for option, value in given.items():
        if value is not None:
            raise ArgumentError(f"{option} is of plans for an arc: add --arc START:STOP")


def run(args: argparse.Namespace) -> int:
    """Print the plan."""
    from ..planning import plan as planning
    from .order_lists import parse_orders

    orders = None if args.orders is None else parse_orders(args.orders)
    if args.after is not None:
        return run_after(args)
    refuse_without_after(args)
    if args.self_method is not None:
        return run_self(args, orders)
    if args.prior is not None:
        return _run_unit(args, orders)
    if args.arc is not None or args.uncertainty is not None:
        return _run_arc(args, orders)
    _refuse_without_arc(args)
    common = {
        "fixed_member": args.fixed_member,
        "orders": orders,
        "noise": args.noise_arcsec,
        "standard_error": args.std_arcsec,
    }
    if args.reference == "encoder":
        plan = planning.plan_encoder(args.gear_ratio, args.positions, **common)
    else:
        positions = 36 if args.positions is None else args.positions
        if args.reference == "off-null":
            plan = planning.plan_tilts(
                args.gear_ratio, positions, args.tilts, tilt_arcsec=args.tilt_arcsec, **common
            )
        else:
            mounts = 2 if args.mounts is None else args.mounts
            plan = planning.plan_mounts(args.gear_ratio, positions, mounts, **common)
    print(plan.to_json() if args.json else plan.summary())
    return 0
