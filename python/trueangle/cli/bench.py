"""``trueangle bench``: what this machine reaches, in about a minute."""

from __future__ import annotations

import argparse
import json

HELP = "measure evaluation and correction on this machine, beside copies and other libraries"
EXAMPLE = "trueangle bench --json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--samples", type=int, default=1_000_000, help="size of the large batches")
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each measurement")
    parser.add_argument("--json", action="store_true", help="print the medians as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print."""
    from ..bench import evaluation
    from ..errors import ArgumentError

    if args.samples < 1 or args.rounds < 1:
        raise ArgumentError(
            f"--samples and --rounds must be 1 or more, got {args.samples} and {args.rounds}"
        )
    peers, missing = evaluation.peer_batches(min(args.samples, 100_000), args.rounds)
    parts = {
        "batches": evaluation.batches(args.samples, args.rounds),
        "peers": peers,
        "calls_of_37_samples": evaluation.small(rounds=20 * args.rounds),
        "single_samples": evaluation.single(rounds=20 * args.rounds),
    }
    path = evaluation.harmonics([1])._series.path
    if args.json:
        medians = {
            part: {row.name: row.nanoseconds for row in rows} for part, rows in parts.items()
        }
        print(json.dumps({"path": path, "nanoseconds": medians, "missing": missing}, indent=2))
        return 0
    print(f"default path: {path}")
    for part, rows in parts.items():
        print(f"\n{part.replace('_', ' ')}: median (least .. greatest) ns each")
        for row in rows:
            scale = 1e9 / row.samples
            least, most = row.timing.least * scale, row.timing.most * scale
            print(f"  {row.name:38s} {row.nanoseconds:10.2f} ({least:.2f} .. {most:.2f})")
    for name in missing:
        print(f"  {name:38s} not installed")
    return 0
