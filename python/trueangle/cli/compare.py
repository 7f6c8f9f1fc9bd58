"""``trueangle compare``: the difference of two models."""

from __future__ import annotations

import argparse
from functools import partial

from ..support.plainresult import json_text
from .options import add_shared, errors_in
from .parser import Input, declare
from .robots import model_asked, refuse_joint

HELP = "difference of two models per order and over the turn"
EXAMPLE = "trueangle compare present.json joint_a.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("first A", Input, "model file: today's table, or the joint before a repair")
    add("second B", Input, "model file: the new calibration; B less A is printed")
    add("--joint NAME", str, "joint to take from the file of a robot")
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the difference."""
    from ..export.comparison import compare

    refuse_joint(args.joint, (args.first, args.second))
    first, second = (model_asked(path, args.joint) for path in (args.first, args.second))
    result = compare(first, second)
    if args.json:
        print(json_text(result.to_dict()))
    else:
        print(result.summary(errors_in(args)))
    return 0
