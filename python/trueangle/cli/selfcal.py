"""``trueangle selfcal``: calibrate without a reference."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..selfcalibration import LOOPS, METHODS
from .options import add_shared, show
from .parser import Input, declare
from .robots import add_robot, each_joint, joints_asked, save_models, show_joints
from .signal_options import add_signals, reading_options
from .values import parse_orders

if TYPE_CHECKING:
    from ..selfcalibration.result import SelfCalibration
    from .robots import JointAsked

HELP = "calibrate without a reference: from time stamps, heads, shifts or the motor"
EXAMPLE = "trueangle selfcal coast.csv -o joint.json --loop open"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("logs LOGS...", Input, "CSV or Parquet logs of the joint")
    add_shared(parser, "model-output")
    add(
        "--method",
        ("auto", *METHODS),
        "auto (default) looks at the columns: time_s, head1_deg, shift_deg, motor_deg, sine "
        "and cosine",
        default="auto",
    )
    add("--orders", str, "auto (default: the significant ones), 1-24 or 1,4,8", default="auto")
    add(
        "--loop",
        LOOPS,
        "was the speed held by a loop closed on this encoder? (default: %(default)s)",
        default="unknown",
    )
    add("--loop-bandwidth HZ", float, "bandwidth of that loop")
    add("--gear-ratio R", float, "motor turns per output turn: stays as given")
    add("--fit-ratio", bool, "estimate the gear ratio jointly with orders 1 and 2 of the output")
    add(
        "--ripple auto|none|1-4",
        str,
        "orders at which the speed may ripple (default: all, weighed by the evidence)",
        default="auto",
    )
    add(
        "--head-angles 0,119.2,203.7",
        str,
        "angles of the heads, degrees, if their readings share one zero",
    )
    add_signals(parser, runs=False)
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")
    add_robot(parser)


def run(args: argparse.Namespace) -> int:
    """Calibrate, save, print."""
    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    result = _calibrated(args)
    result.model.save(args.output)
    if not result.model.shafts and result.channels is None:
        print("trueangle: warning: the model corrects nothing", file=sys.stderr)
    show(args, result, args.output, named="model")
    return 0


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """Calibrate every joint; one file of all models."""
    found, _ = each_joint(joints, lambda joint: _calibrated(joint.args))
    save_models(args.output, name, joints, {joint: r.model for joint, r in found.items()})
    show_joints(args, found, saved=args.output)
    return 0


def _calibrated(args: argparse.Namespace) -> SelfCalibration:
    from ..selfcalibration.calibrate import selfcal

    ripple = args.ripple
    return selfcal(
        args.logs,
        method=args.method,
        orders=args.orders if args.orders == "auto" else _whole(args.orders, "--orders"),
        loop=args.loop,
        loop_bandwidth=args.loop_bandwidth,
        gear_ratio=args.gear_ratio,
        fit_ratio=args.fit_ratio,
        ripple=ripple if ripple in ("auto", "none") else _whole(ripple, "--ripple"),
        head_angles=None if args.head_angles is None else _numbers(args.head_angles),
        **reading_options(args),
    )


def _whole(text: str, option: str) -> tuple[float, ...]:
    orders = parse_orders(text, option)
    if any(k != int(k) for k in orders):
        raise ArgumentError(f"{option}: orders must be whole numbers, got {text!r}")
    return orders


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ArgumentError(f"--head-angles: degrees such as 0,119.2,203.7, got {text!r}") from None
