"""``trueangle diagnose``: name what a simulation lacks."""

from __future__ import annotations

import argparse

HELP = "name the physical causes that a simulation of the joint lacks"
EXAMPLE = "trueangle diagnose runs.csv --simulation joint.toml --extend better.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("runs", nargs="+", metavar="RUNS", help="calibration runs (CSV or Parquet)")
    add("--simulation", required=True, metavar="FILE", help="simulation file (TOML)")
    add("--extend", metavar="FILE", help="write the simulation extended by the findings")
    add("--counts-per-turn", type=float, metavar="N", help="unit of indicated_count")
    add("--json", action="store_true", help="print the diagnosis as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the diagnosis."""
    from ..diagnosis import diagnose
    from ..runfiles import read_runs
    from ..simulation import load_simulation

    simulation = load_simulation(args.simulation)
    runs = read_runs(args.runs, counts_per_turn=args.counts_per_turn)
    result = diagnose(runs, simulation)
    if args.extend:
        result.extended.save(args.extend)
    if args.json:
        print(result.to_json(args.extend))
    else:
        print(result.summary())
        if args.extend:
            print(f"\nExtended simulation: {args.extend}")
    return 0
