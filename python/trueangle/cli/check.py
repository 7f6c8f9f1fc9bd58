"""``trueangle check``: are data fit to be used before anything is fitted."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import FileError, NoModelError
from .parser import Input, declare
from .robots import add_robot, each_joint, joints_asked, show_joints
from .signal_options import add_signals, of_joint, reading_options

if TYPE_CHECKING:
    from .robots import JointAsked

HELP = "check data for faults before a fit, and report what they can determine"
EXAMPLE = "trueangle check runs.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("files FILES...", Input, "calibration runs of any format")
    add_signals(parser)
    add_robot(parser)
    add("--json", bool, "print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the check; 1 where a fault makes the data unusable."""
    from ..runs.checks.check import check

    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    try:
        found = check(args.files, **reading_options(args))
    except FileError as error:
        channels = _of_channels(args)
        if channels is not None:
            return channels
        _tell_columns(error, args)
        raise
    print(found.to_json() if args.json else found.summary())
    return 0 if found.usable else 1


def _of_channels(args: argparse.Namespace) -> int | None:
    """The status of files of channels without a reference; None of others."""
    from ..selfcalibration.channelcheck import check_channels

    try:
        found = check_channels(args.files, **reading_options(args))
    except (FileError, NoModelError):
        return None
    print(found.to_json() if args.json else found.summary())
    return 0 if found.usable else 1


def _tell_columns(error: FileError, args: argparse.Namespace) -> None:
    """Print what a log seems to hold whose columns are not known."""
    from ..runs.checks.columns import columns_of_log
    from ..runs.paths import find_logs

    if error.line != 1 or "no column" not in error.problem:
        return
    for path, _ in find_logs(args.files, whole=False):
        held = columns_of_log(path, args.topic) if path.is_file() else None
        if held is not None:
            print(held.to_json() if args.json else f"{held.summary()}\n", flush=True)
            return


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """Check every joint; 1 where the data of one are unusable."""
    from ..reports.robot import checked_rank
    from ..runs.checks.check import check
    from ..runs.files import read_runs

    def work(joint: JointAsked) -> Any:
        found = check(joint.args.files, **reading_options(joint.args))
        try:
            runs = read_runs(joint.args.files, **reading_options(joint.args))
        except FileError:  # the check reports what is wrong
            runs = None
        return found, checked_rank(joint.name, found, runs)

    found, _ = each_joint(joints, work)
    checks = {joint: result for joint, (result, _) in found.items()}
    show_joints(
        args,
        checks,
        (rank for _, rank in found.values()),
        f"Data of {name or 'the robot'}",
        told=lambda joint: of_joint(checks[joint].summary(), joint),
    )
    return 0 if all(result.usable for result in checks.values()) else 1
