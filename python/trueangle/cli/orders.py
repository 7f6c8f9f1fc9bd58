"""``trueangle orders``: which orders of the error are real."""

from __future__ import annotations

import argparse
import json
import math
from typing import TYPE_CHECKING

from .error_units import add_errors_in, errors_in
from .fit import add_argument_choice, add_covariance, add_joint, add_nuisance
from .onepass import add_one_pass, printed_orders, wants_one_pass
from .order_lists import declared_shafts, parse_orders
from .paths import Input

if TYPE_CHECKING:
    from ..orders.table import OrderRow, OrderSelection

HELP = "say which orders of the angle error are real, and what they may be"
EXAMPLE = "trueangle orders joint_a.csv --gear-ratio 100"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("runs", nargs="+", type=Input, metavar="RUNS", help="files of readings")
    add("--orders", metavar="1-17,202", help="candidates (default: low orders and the gear's own)")
    add_joint(parser)
    add_argument_choice(parser)
    add_covariance(parser)
    add(
        "--method",
        choices=("evidence", "paper"),
        default="evidence",
        help="evidence (default): significance and held-out error; paper: amplitude and phase "
        "range over the runs",
    )
    add_nuisance(parser)
    add("--run", action="append", metavar="LABEL", help="use this run only (may be repeated)")
    add_one_pass(parser)
    add_errors_in(parser)
    add("--json", action="store_true", help="print the table as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the table of orders."""
    from ..fitting.robust import without_spikes
    from ..orders.select import select_orders
    from .run_lists import read_selected

    if wants_one_pass(args):
        return printed_orders(args)
    runs = read_selected(args)
    reference = () if args.reference_orders is None else parse_orders(args.reference_orders)
    selection = select_orders(
        [without_spikes(run) for run in runs],
        None if args.orders is None else parse_orders(args.orders),
        args.gear_ratio,
        args.fixed_member,
        args.method,
        argument=args.argument,
        covariance=args.covariance,
        nuisance=args.nuisance,
        shafts=declared_shafts(args.shaft),
        reference_orders=reference,
    )
    if args.json:
        print(json.dumps(as_json(selection), indent=2))
    else:
        print(selection.summary(errors_in(args)))
    return 0


def as_json(selection: OrderSelection) -> dict[str, object]:
    """The selection as plain values, angles in arcsec; what is not a number becomes null."""
    scale = 1_296_000.0 / selection.period
    before, after = selection.holdout_rms
    return {
        "distinct_positions": len(selection.positions),
        "positions": selection.positions.describe(),
        "samples": selection.samples,
        "runs": selection.runs,
        "method": selection.method,
        "argument": selection.argument,
        "noise_arcsec": _finite(scale * selection.noise.standard_deviation),
        "noise_source": selection.noise.source,
        "holdout": selection.holdout,
        "holdout_rms_before_arcsec": _finite(scale * before),
        "holdout_rms_after_arcsec": _finite(scale * after),
        "reason": selection.reason,
        "notes": list(selection.notes),
        "orders": [_row(row, scale) for row in selection.table],
    }


def _row(row: OrderRow, scale: float) -> dict[str, object]:
    return {
        "order": row.order,
        "retained": row.retained,
        "verdict": row.verdict,
        "amplitude_arcsec": _finite(scale * row.amplitude),
        "phase_deg": _finite(row.phase_deg % 360.0),
        "std_arcsec": _finite(scale * row.standard_error),
        "phase_std_deg": _finite(row.phase_error_deg),
        "phase_spread_deg": _finite(row.phase_spread_deg),
        "log10_false_alarm": _finite(row.log10_false_alarm),
        "holdout_gain": _finite(row.holdout_gain),
        "aliases": list(row.aliases),
        "explanations": [str(e) for e in row.explanations],
        "reason": row.reason,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
