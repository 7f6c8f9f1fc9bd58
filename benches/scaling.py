"""Time over readings, orders, threads, workers, units and windows, and the model of cost.

    python benches/scaling.py [--largest 1e7] [--rounds 5] [--workers 1,2,4] [--plot FILE] [--json]

``--largest`` is the largest number of readings (24 bytes of memory each); fleets have up to a
ten-thousandth of it. ``--workers`` also fits logs of that size with Dask workers on this machine.
"""

from __future__ import annotations

import argparse
import json
from typing import Any, Final

import numpy as np

from harness import scaling
from harness.scaling import MeasuredWork, WorkCost

#: A unit of a fleet takes as long as this number of readings of a fit.
_READINGS_TO_A_UNIT: Final = 10_000


def main(arguments: list[str] | None = None) -> int:
    """Read the arguments, measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=float, default=1e7, metavar="N")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--workers", metavar="1,2,4")
    parser.add_argument("--plot", metavar="FILE")
    parser.add_argument("--json", action="store_true")
    return run(parser.parse_args(arguments))


def run(args: argparse.Namespace) -> int:
    """Measure how time grows, print and draw it."""
    try:
        workers = [int(count) for count in args.workers.split(",")] if args.workers else []
    except ValueError:
        workers = [0]
    if not 1e3 <= args.largest <= 1e10 or args.rounds < 1 or any(w < 1 for w in workers):
        given = f"--largest {args.largest:g} --rounds {args.rounds}"
        given += f" --workers {args.workers}" if args.workers else ""
        raise SystemExit(
            "--largest must lie between 1e3 and 1e10, --rounds and --workers must be whole numbers "
            f"from 1, got {given}"
        )
    size = int(args.largest)
    grown = scaling.scaling_by_readings(size, args.rounds)
    # Orders far fewer than readings: the moments take these, and they tell all orders.
    some = min(size, scaling.READINGS)
    orders = scaling.scaling_by_orders(args.rounds, some // 64, some)
    shared = scaling.scaling_by_workers(workers, size) if workers else []
    shared += scaling.scaling_by_units(size // _READINGS_TO_A_UNIT)
    shared += scaling.scaling_by_windows(some, args.rounds)
    costs = scaling.work_costs(grown)
    if args.plot is not None:
        _draw(args.plot, grown, costs)
    if args.json:
        print(json.dumps(_scaling_values([*grown, *orders, *shared], costs), indent=2))
        return 0
    print(
        f"{'work':16}{'readings':>12}{'orders':>8}{'threads':>8}{'seconds':>12}{'ns/reading':>12}"
    )
    for point in [*grown, *orders, *shared]:
        median = point.timing.median
        print(
            f"{point.work:16}{point.readings:12d}{point.orders:8d}{point.threads:8d}"
            f"{median:12.4g}{1e9 * median / point.readings:12.3g}"
        )
    print(f"\nmodel of cost, {scaling.ORDERS} orders: seconds = call + readings x each")
    for cost in costs:
        print(
            f"  {cost.work}, {cost.threads} thread{'s' * (cost.threads > 1)}: "
            f"{1e6 * cost.call:.3g} us + {1e9 * cost.reading:.3g} ns a reading (within "
            f"{100.0 * cost.spread:.0f} %); 1e12 readings: {cost.seconds(1e12) / 3600.0:.3g} h"
        )
    return 0


def _scaling_values(points: list[Any], costs: list[Any]) -> dict[str, Any]:
    """All of it as plain values."""
    return {
        "measured": [
            {**point._asdict(), "timing": point.timing.median, "least": point.timing.least}
            for point in points
        ],
        "costs": [cost._asdict() for cost in costs],
    }


def _draw(path: str, points: list[MeasuredWork], costs: list[WorkCost]) -> None:
    """Medians as dots and the model of cost as lines, both axes logarithmic."""
    from matplotlib.figure import Figure

    measured: dict[str, list[tuple[float, float]]] = {}
    for point in points:
        label = _label(point.work, point.threads)
        measured.setdefault(label, []).append((point.readings, point.timing.median))
    models = {_label(cost.work, cost.threads): cost for cost in costs}
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    ax = figure.subplots()
    for number, (label, pairs) in enumerate(measured.items()):
        n, seconds = np.array(pairs, dtype=np.float64).T
        ax.loglog(n, seconds, "os^Dv"[number % 5], color=f"C{number}", markersize=5.0, label=label)
        over = np.geomspace(n.min(), n.max(), 100)
        cost = models[label]
        ax.plot(over, cost.call + cost.reading * over, color=f"C{number}", linewidth=1.0)
    ax.set_xlabel("readings")
    ax.set_ylabel("seconds: medians, and the model of cost")
    ax.grid(alpha=0.3)
    ax.legend()
    figure.savefig(path)


def _label(work: str, threads: int) -> str:
    return f"{work}, {threads} thread{'s' * (threads > 1)}"


if __name__ == "__main__":
    raise SystemExit(main())
