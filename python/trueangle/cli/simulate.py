"""``trueangle simulate``: measure a simulated joint."""

from __future__ import annotations

import argparse

from ..support.layout import counted
from ..support.plainresult import json_text
from .options import add_runs_output
from .paths import Input

HELP = "measure a simulated joint: calibration runs from a simulation file"
EXAMPLE = "trueangle simulate joint.toml -o runs.csv --seed 1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "simulation",
        type=Input,
        metavar="FILE",
        help="simulation file (TOML) with at least one [[run]]",
    )
    add_runs_output(parser)
    add("--seed", type=int, default=0, metavar="N", help="seed of the noise (default: 0)")
    add("--json", action="store_true", help="print what was written as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the runs."""
    from ..runs.writing import write_runs
    from ..simulation import load_simulation, simulate

    if args.seed < 0:
        from ..errors import ArgumentError

        raise ArgumentError(f"--seed must not be negative, got {args.seed}")
    runs = simulate(load_simulation(args.simulation), seed=args.seed)
    samples = write_runs(runs, args.output)
    if args.json:
        print(json_text({"runs": len(runs), "samples": samples, "output": args.output}))
    else:
        print(f"{args.output}: {counted(samples, 'reading')} in {counted(runs, 'run')}")
    return 0
