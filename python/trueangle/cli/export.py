"""``trueangle export``: a model as a table that firmware reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from ..support.plainresult import json_text
from .options import add_shared, errors_in
from .parser import Input, Output, declare
from .robots import model_asked

if TYPE_CHECKING:
    from ..export.target import Option

HELP = "write a model as a table for firmware, with a proven bound of its difference"
EXAMPLE = "trueangle export joint_a.json --to c --max-arcsec 2 -o joint_a.h"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from ..export.targets import TARGETS

    add = partial(declare, parser)
    add("model MODEL", Input, "model file written by trueangle fit, also of a robot (--joint)")
    add("--to TARGET", tuple(TARGETS), _targets(), required=True)
    add("-o --output FILE", Output.of(None), "file to write", required=True)
    add(
        "--max-arcsec E",
        float,
        "take the smallest table that differs from the model by at most this",
    )
    add_target_options(parser, {"joint": "of the file of a robot, the joint to write"})
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")


def add_target_options(
    parser: argparse.ArgumentParser, more: Mapping[str, str] | None = None
) -> None:
    """Options of the targets, each once; a target refuses those it does not have.

    ``more`` is what some of them mean in addition.
    """
    from ..export.targets import TARGETS

    options: dict[str, dict[str, list[str]]] = {}
    read = {name for target in TARGETS.values() for name in target.files}
    for target in TARGETS.values():
        for name, option in target.options.items():
            options.setdefault(name, {}).setdefault(_help(option), []).append(target.name)
    for name, helps in sorted(options.items()):
        parser.add_argument(
            *([f"--{name.replace('_', '-')}"] + (["--table"] if name == "entries" else [])),
            dest=f"option_{name}",
            type=Input if name in read else str,
            metavar="FILE" if name in read else name.upper().replace("_", "-"),
            help="; ".join(
                [
                    *(f"{', '.join(names)}: {text}" for text, names in helps.items()),
                    *([more[name]] if more and name in more else []),
                ]
            ),
        )


def _help(option: Option) -> str:
    words = f": {' or '.join(option.values)}" if isinstance(option.values, tuple) else ""
    default = "" if option.default in (None, "") else f" (default: {option.default})"
    return f"{option.help}{words}{default}"


def target_options(args: argparse.Namespace) -> dict[str, str]:
    """Those that were given."""
    prefix = "option_"
    return {
        name.removeprefix(prefix): value
        for name, value in vars(args).items()
        if name.startswith(prefix) and value is not None
    }


def _targets() -> str:
    from ..export.targets import TARGETS

    return "; ".join(f"{target.name}: {target.what}" for target in TARGETS.values())


def run(args: argparse.Namespace) -> int:
    """Write the table."""
    import sys

    from ..export import export_model
    from ..export.targets import TARGETS
    from ..model.robot import is_robot_file
    from ..support.files import check_output

    options = target_options(args)
    model = args.model
    if is_robot_file(model):
        target = TARGETS[args.to]
        check_output(args.output, target.kind, [args.model])
        model = model_asked(args.model, options.get("joint"))
        if "joint" not in target.options:
            options.pop("joint", None)
    made = export_model(model, args.to, args.output, max_arcsec=args.max_arcsec, **options)
    if args.json:
        print(json_text(made.to_dict()))
        for note in made.notes:
            print(f"trueangle: note: {note}", file=sys.stderr)
    else:
        print(made.summary(errors_in(args)))
    return 0
