"""``trueangle compare``: the difference of two models."""

from __future__ import annotations

import argparse

from ..support.plainresult import json_text
from .options import add_errors_in, errors_in
from .paths import Input
from .robotmodel import model_asked, refuse_joint

HELP = "difference of two models per order and over the turn"
EXAMPLE = "trueangle compare present.json joint_a.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "first",
        type=Input,
        metavar="A",
        help="model file: today's table, or the joint before a repair",
    )
    add(
        "second",
        type=Input,
        metavar="B",
        help="model file: the new calibration; B less A is printed",
    )
    add("--joint", metavar="NAME", help="of the file of a robot, this joint")
    add_errors_in(parser)
    add("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the difference."""
    from ..export import compare

    refuse_joint(args.joint, (args.first, args.second))
    first, second = (model_asked(path, args.joint) for path in (args.first, args.second))
    result = compare(first, second)
    if args.json:
        print(json_text(result.to_dict()))
    else:
        print(result.summary(errors_in(args)))
    return 0
