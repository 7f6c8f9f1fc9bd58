"""``trueangle plan``: positions that keep the wanted orders apart."""

from __future__ import annotations

import argparse

from .selfplan import add_self_arguments, run_self

HELP = "propose calibration positions that keep the wanted orders apart"
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
    add("--json", action="store_true", help="print the plan as JSON")
    add_self_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Print the plan."""
    from ..planning import plan as planning
    from .order_lists import parse_orders

    orders = None if args.orders is None else parse_orders(args.orders)
    if args.self_method is not None:
        return run_self(args, orders)
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
