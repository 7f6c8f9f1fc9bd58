"""``trueangle selfcal``: calibrate without a reference."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..selfcalibration.methods import LOOPS, METHODS
from ..support.plainresult import json_text
from .options import add_errors_in, add_model_output, errors_in
from .paths import Input
from .robots import add_robot, each_joint, joints_asked, save_models
from .signal_options import add_signals, reading_options
from .values import parse_orders

if TYPE_CHECKING:
    from ..selfcalibration.result import SelfCalibration
    from .robots import JointAsked

HELP = "calibrate without a reference: from time stamps, heads, shifts or the motor"
EXAMPLE = "trueangle selfcal coast.csv -o joint.json --loop open"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("logs", nargs="+", type=Input, metavar="LOGS", help="CSV or Parquet logs of the joint")
    add_model_output(parser)
    add(
        "--method",
        choices=("auto", *METHODS),
        default="auto",
        help="auto (default) looks at the columns: time_s, head1_deg, shift_deg, motor_deg, sine "
        "and cosine",
    )
    add("--orders", default="auto", help="auto (default: those that stand out), 1-24 or 1,4,8")
    add(
        "--loop",
        choices=LOOPS,
        default="unknown",
        help="was the speed held by a loop closed on this encoder? (default: %(default)s)",
    )
    add("--loop-bandwidth", type=float, metavar="HZ", help="of that loop")
    add("--gear-ratio", type=float, metavar="R", help="motor turns per output turn: stays as given")
    add(
        "--fit-ratio",
        action="store_true",
        help="estimate the gear ratio jointly with orders 1 and 2 of the output",
    )
    add(
        "--ripple",
        default="auto",
        metavar="auto|none|1-4",
        help="orders at which the speed may ripple (default: all, weighed by the evidence)",
    )
    add(
        "--head-angles",
        metavar="0,119.2,203.7",
        help="where the heads stand, degrees, if their readings share one zero",
    )
    add_signals(parser, runs=False)
    add_errors_in(parser)
    add("--json", action="store_true", help="print the result as JSON")
    add_robot(parser)


def run(args: argparse.Namespace) -> int:
    """Calibrate, save, print."""
    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    result = _calibrated(args)
    result.model.save(args.output)
    if not result.model.shafts and result.channels is None:
        print(
            "trueangle: warning: no order can be given as the encoder's: the model corrects "
            "nothing",
            file=sys.stderr,
        )
    if args.json:
        print(json_text({"model": args.output, **result.to_dict()}))
    else:
        print(result.summary(errors_in(args)))
        print(f"\nsaved {args.output}")
    return 0


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """Calibrate every joint; one file of all models."""

    def work(joint: JointAsked) -> SelfCalibration:
        return _calibrated(joint.args)

    found, _ = each_joint(joints, work)
    save_models(args.output, name, joints, {joint: r.model for joint, r in found.items()})
    if args.json:
        plain = {joint: result.to_dict() for joint, result in found.items()}
        print(json_text({"model": args.output, "joints": plain}))
    else:
        for joint, result in found.items():
            print(f"--- {joint} ---\n{result.summary(errors_in(args))}\n")
        print(f"saved {args.output}")
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
        raise ArgumentError(f"{option}: orders of a self-calibration are whole, got {text!r}")
    return orders


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ArgumentError(f"--head-angles: degrees such as 0,119.2,203.7, got {text!r}") from None
