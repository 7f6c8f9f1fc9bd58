"""``trueangle orders``: which orders of the error are real."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from .fit import add_one_pass, log_options, refuse_robot, wants_one_pass
from .options import add_joint, add_shared, show
from .parser import Input, declare
from .robots import add_robot, each_joint, joints_asked, show_joints
from .values import declared_shafts, parse_orders

if TYPE_CHECKING:
    from ..fitting.orders.result import OrderSelection

HELP = "list which orders of the angle error are real, and their possible sources"
EXAMPLE = "trueangle orders joint_a.csv --gear-ratio 100"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("runs RUNS...", Input, "files of readings")
    add("--orders 1-17,202", str, "candidates (default: low orders and the gear's own)")
    add_joint(parser)
    add_robot(parser)
    add_shared(parser, "argument", "covariance")
    add(
        "--method",
        ("evidence", "paper"),
        "evidence (default): significance and held-out error; paper: amplitude and phase "
        "range over the runs",
        default="evidence",
    )
    add_shared(parser, "nuisance", "reference-orders", "run")
    add_one_pass(parser)
    add_shared(parser, "errors-in")
    add("--json", bool, "print the table as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the table of orders."""
    asked = joints_asked(args)
    if asked is not None:
        refuse_robot(args)
        tables, _ = each_joint(asked[1], lambda joint: _in_memory(joint.args))
        show_joints(args, tables)
        return 0
    show(args, _in_one_pass(args) if wants_one_pass(args) else _in_memory(args))
    return 0


def _in_memory(args: argparse.Namespace) -> OrderSelection:
    from ..fitting.orders.select import select_orders
    from .run_lists import read_selected_runs

    reference = (
        ()
        if args.reference_orders is None
        else parse_orders(args.reference_orders, "--reference-orders")
    )
    return select_orders(
        read_selected_runs(args),
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


def _in_one_pass(args: argparse.Namespace) -> OrderSelection:
    from ..logs.fitting import select_log_orders

    if args.orders is not None or args.method != "evidence":
        raise ArgumentError(
            "--orders and --method need all readings in memory, not logs in one pass"
        )
    return select_log_orders(args.runs, **log_options(args))
