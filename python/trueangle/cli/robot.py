"""``trueangle robot``: write the robot file from a URDF."""

from __future__ import annotations

import argparse
from functools import partial

from ..support.files import SIMULATION
from ..support.plainresult import json_text
from .parser import Input, Output, declare

HELP = "write a robot file: names and gear ratios of the joints of a URDF"
EXAMPLE = "trueangle robot --from-urdf arm.urdf -o robot.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add(
        "--from-urdf URDF",
        Input,
        "robot description: its revolute and continuous joints, in their order, and the "
        "mechanicalReduction of their transmissions",
        required=True,
    )
    add(
        "-o --output FILE",
        Output.of(SIMULATION),
        "robot file to write (TOML); add the columns of the reference there",
        required=True,
    )
    add("--json", bool, "print the joints as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the robot file."""
    from ..joint.description import robot_of_urdf

    robot = robot_of_urdf(args.from_urdf)
    robot.save(args.output)
    joints = [{"name": joint.name, "gear_ratio": joint.gear_ratio} for joint in robot.joints]
    if args.json:
        print(json_text({"robot": args.output, "name": robot.name, "joints": joints}))
        return 0
    for joint in robot.joints:
        ratio, column = joint.gear_ratio, joint.signals["indicated"].removesuffix(":rad")
        called = joint.name if joint.name == column else f"{joint.name} ({column!r} in the URDF)"
        print(f"{called}: " + ("no gear ratio" if ratio is None else f"ratio {ratio:g}"))
    print(f"\nsaved {args.output}")
    print("name the columns of every reference under [joint.signals], as")
    print('reference = "laser3:deg"')
    return 0
