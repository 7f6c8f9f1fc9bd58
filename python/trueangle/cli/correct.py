"""``trueangle correct``: logs in, the same logs with the corrected angle out."""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path

from ..errors import ArgumentError

HELP = "correct the indicated angles of logs with a saved model"
EXAMPLE = "trueangle correct log.csv -m joint_a.json -o corrected.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("logs", nargs="+", metavar="LOG", help="CSV files of readings")
    parser.add_argument("-m", "--model", required=True, help="model file written by trueangle fit")
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="file to write; a folder for several"
    )
    parser.add_argument("--column", metavar="NAME", help="of the angle (default: indicated_*)")
    parser.add_argument(
        "--unit",
        choices=("deg", "rad", "turn", "count"),
        help="of that column (default: the ending of its name, else the model's)",
    )
    parser.add_argument("--counts-per-turn", type=float, metavar="N", help="of an angle in counts")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Correct every log."""
    from ..logs.columns import find_angle_column
    from ..logs.csvlog import correct_csv
    from ..model import load_model

    model = load_model(args.model)
    done = []
    for source, target in _targets([Path(log) for log in args.logs], Path(args.output)):
        lines = correct_csv(
            source,
            target,
            model,
            partial(
                find_angle_column,
                source,
                model.period,
                column=args.column,
                unit=args.unit,
                counts_per_turn=args.counts_per_turn,
            ),
        )
        done.append({"log": str(source), "output": str(target), "rows": lines})
        if not args.json:
            print(f"{source}: {lines} readings corrected -> {target}")
    if args.json:
        print(json.dumps({"files": done}))
    return 0


def _targets(sources: list[Path], output: Path) -> list[tuple[Path, Path]]:
    """Where every log goes; never onto a log itself."""
    into_folder = len(sources) > 1 or output.is_dir()
    if into_folder:
        output.mkdir(parents=True, exist_ok=True)
    pairs = [(source, output / source.name if into_folder else output) for source in sources]
    for source, target in pairs:
        if not source.is_file():
            raise ArgumentError(f"{source}: no such file")
        if target.exists() and target.samefile(source):
            raise ArgumentError(f"{source}: the output would overwrite it; name another with -o")
    names = [target for _, target in pairs]
    doubled = next((name for name in names if names.count(name) > 1), None)
    if doubled is not None:
        raise ArgumentError(f"{doubled}: two logs of this name; correct them into other folders")
    return pairs
