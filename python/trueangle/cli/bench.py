"""``trueangle bench``: what this machine reaches, in about a minute."""

from __future__ import annotations

import argparse
from typing import Any

from ..support.files import PICTURE
from ..support.plainresult import json_text
from .options import refuse_given
from .paths import Output
from .pictures import save_picture

HELP = "measure evaluation, correction and fits here, and those of other libraries"
EXAMPLE = "trueangle bench --json"

#: Readings of a batch, and at most of what grows.
_SAMPLES, _LARGEST = 1_000_000, 1e7

#: A unit of a fleet takes as long as so many readings of a fit.
_READINGS_TO_A_UNIT = 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--samples", type=int, metavar="N", help="size of the large batches (default: 1000000)"
    )
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each measurement")
    parser.add_argument(
        "--scaling",
        action="store_true",
        help="how time grows with readings, orders, threads, units and windows",
    )
    parser.add_argument(
        "--largest",
        type=float,
        metavar="N",
        help="with --scaling: most readings (24 bytes of memory each), 1e7 by default; fleets have "
        "up to N / 10000 units",
    )
    parser.add_argument(
        "--workers",
        metavar="1,2,4",
        help="with --scaling: fit logs of N readings with so many Dask workers here, too",
    )
    parser.add_argument(
        "--plot",
        type=Output.of(PICTURE),
        metavar="FILE",
        help="with --scaling: draw it (needs trueangle[plot])",
    )
    parser.add_argument("--json", action="store_true", help="print the medians as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print."""
    if args.scaling:
        refuse_given(args, ("samples",), "does not go with --scaling: it has --largest")
        args.largest = _LARGEST if args.largest is None else args.largest
        return _scaling(args)
    from ..errors import ArgumentError
    from .benchmarks import evaluation, fit

    refuse_given(args, ("largest", "workers", "plot"), "goes with --scaling")
    args.samples = _SAMPLES if args.samples is None else args.samples
    if args.samples < 1 or args.rounds < 1:
        raise ArgumentError(
            f"--samples and --rounds must be 1 or more, got {args.samples} and {args.rounds}"
        )
    peers, missing = evaluation.evaluate_peers(min(args.samples, 100_000), args.rounds)
    parts = {
        "batches": evaluation.evaluate_batches(args.samples, args.rounds),
        "peers": peers,
        "calls_of_37_samples": evaluation.evaluate_small(rounds=20 * args.rounds),
        "single_samples": evaluation.evaluate_single(rounds=20 * args.rounds),
    }
    fits = fit.quick_fits(min(args.samples, 100_000), args.rounds)
    missing = sorted({*missing, *fit.fit_peers()[1]})
    path = evaluation.evaluated_model([1])._series.path
    if args.json:
        medians = {
            part: {row.name: row.nanoseconds for row in rows} for part, rows in parts.items()
        }
        medians["fits"] = {
            f"{row.name}, {row.case.samples} readings": 1e9 * row.timing.median for row in fits
        }
        print(json_text({"path": path, "nanoseconds": medians, "missing": missing}, indent=2))
        return 0
    print(f"default path: {path}")
    for part, rows in parts.items():
        print(f"\n{part.replace('_', ' ')}: median (least .. greatest) ns each")
        for row in rows:
            scale = 1e9 / row.samples
            least, most = row.timing.least * scale, row.timing.most * scale
            print(f"  {row.name:42s} {row.nanoseconds:10.2f} ({least:.2f} .. {most:.2f})")
    print("\nfits of all readings: median (least .. greatest) microseconds")
    for fitted in fits:
        name = f"{fitted.name}, {fitted.case.samples} x {fitted.case.highest} orders"
        median, least, most = (1e6 * seconds for seconds in fitted.timing)
        print(f"  {name:42s} {median:10.1f} ({least:.1f} .. {most:.1f})")
    for name in missing:
        print(f"  {name:42s} not installed")
    return 0


def _scaling(args: argparse.Namespace) -> int:
    """Measure how time grows, print and draw it."""
    from ..errors import ArgumentError
    from .benchmarks import scaling

    try:
        workers = [int(count) for count in args.workers.split(",")] if args.workers else []
    except ValueError:
        workers = [0]
    if not 1e3 <= args.largest <= 1e10 or args.rounds < 1 or any(w < 1 for w in workers):
        given = f"--largest {args.largest:g} --rounds {args.rounds}"
        given += f" --workers {args.workers}" if args.workers else ""
        raise ArgumentError(
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
        print(json_text(_scaling_values([*grown, *orders, *shared], costs), indent=2))
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


def _draw(path: str, points: list[Any], costs: list[Any]) -> None:
    """Medians as dots and the model of cost as lines, both axes logarithmic."""
    import numpy as np

    from ..plots import palette
    from ..plots.canvas import described, grid, legend, new_axes

    measured: dict[str, list[tuple[float, float]]] = {}
    for point in points:
        label = _label(point.work, point.threads)
        measured.setdefault(label, []).append((point.readings, point.timing.median))
    models = {_label(cost.work, cost.threads): cost for cost in costs}
    ax = new_axes(None, height=4.5)
    for number, (label, pairs) in enumerate(measured.items()):
        n, seconds = np.array(pairs, dtype=np.float64).T
        colour, marker = palette.run_colour(number), palette.MARKERS[number % len(palette.MARKERS)]
        ax.plot(n, seconds, marker, color=colour, markersize=5.0, label=label)
        if label in models:
            over = np.geomspace(n.min(), n.max(), 100)
            cost = models[label]
            ax.plot(over, cost.call + cost.reading * over, color=colour, linewidth=1.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("readings")
    ax.set_ylabel("seconds: medians, and the model of cost")
    grid(ax)
    legend(ax)
    told = "; ".join(
        f"{label}: " + ", ".join(f"{x:.0e} in {t:.2g} s" for x, t in pairs)
        for label, pairs in measured.items()
    )
    save_picture(described(ax, f"Seconds over readings: {told}."), path)


def _label(work: str, threads: int) -> str:
    return f"{work}, {threads} thread{'s' * (threads > 1)}"
