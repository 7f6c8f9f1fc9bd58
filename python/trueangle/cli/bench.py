"""``trueangle bench``: what this machine reaches, in about a minute."""

from __future__ import annotations

import argparse
import json

HELP = "measure evaluation, correction and fits here, beside copies and other libraries"
EXAMPLE = "trueangle bench --json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--samples", type=int, default=1_000_000, help="size of the large batches")
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each measurement")
    parser.add_argument("--json", action="store_true", help="print the medians as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print."""
    from ..bench import evaluation, fit, fitpeers
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
    fits = fit.quick(min(args.samples, 100_000), args.rounds)
    missing = sorted({*missing, *fitpeers.peers()[1]})
    path = evaluation.harmonics([1])._series.path
    if args.json:
        medians = {
            part: {row.name: row.nanoseconds for row in rows} for part, rows in parts.items()
        }
        medians["fits"] = {
            f"{row.name}, {row.case.samples} readings": 1e9 * row.timing.median for row in fits
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
    print("\nfits of all readings: median (least .. greatest) microseconds")
    for fitted in fits:
        name = f"{fitted.name}, {fitted.case.samples} x {fitted.case.highest} orders"
        median, least, most = (1e6 * seconds for seconds in fitted.timing)
        print(f"  {name:38s} {median:10.1f} ({least:.1f} .. {most:.1f})")
    for name in missing:
        print(f"  {name:38s} not installed")
    return 0
