"""``trueangle simulate``: measure a simulated joint."""

from __future__ import annotations

import argparse
from functools import partial

from ..support.layout import counted
from ..support.plainresult import json_text
from .options import add_shared
from .parser import Input, declare

HELP = "measure a simulated joint: calibration runs from a simulation file"
EXAMPLE = "trueangle simulate joint.toml -o runs.csv --seed 1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("simulation FILE", Input, "simulation file (TOML) with at least one [[run]]")
    add_shared(parser, "runs-output")
    add("--seed N", int, "seed of the noise (default: 0)", default=0)
    add("--json", bool, "print what was written as JSON")


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
