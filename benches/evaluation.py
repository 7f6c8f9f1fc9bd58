"""Evaluation targets: batches, small calls, single samples, latency, peers.

    python benches/evaluation.py [--samples 10000000] [--rounds 7] [--latency SECONDS]
                                 [--save FILE.npz] [--plot FILE]

Ways are interleaved within one run; ratios of medians are what counts. ``--latency``
paces a loop for so many seconds at 1 and at 10 kHz and ``--save`` keeps every latency.
``--plot`` draws all ways over the array (SVG, PNG, PDF; needs ``trueangle[plot]``).
"""

from __future__ import annotations

import argparse
import platform

import numpy as np

from harness import evaluation
from harness.evaluation import EvaluationRow
from latency import histogram, paced


def show(title: str, rows: list[EvaluationRow], base: str, ratio: str) -> None:
    print(f"\n{title}")
    unit = next(row for row in rows if row.name == base).timing
    for row in rows:
        t = row.timing
        scale = 1e9 / row.samples
        print(
            f"  {row.name:38s} {t.median * scale:10.2f} ns"
            f" ({t.least * scale:.2f} .. {t.most * scale:.2f})"
            f"   {ratio} {t.median / unit.median:8.2f}, of minima {t.least / unit.least:8.2f}"
        )


def latencies(seconds: float, save: str | None) -> None:
    step = evaluation.evaluated_model(evaluation.ORDERS["17 orders"]).compensator()
    kept = {}
    for rate in (1e3, 1e4):
        for name, function in (("empty", float), ("step", step)):
            found = paced(name, function, rate, int(seconds * rate))
            kept[f"{name}_{rate:.0f}Hz"] = found.nanoseconds
            quantiles = ", ".join(f"{q} {v:.0f} ns" for q, v in found.quantiles().items())
            print(f"\n{name} at {rate:.0f} Hz, {found.nanoseconds.size} calls: {quantiles}")
            print(histogram(found))
    if save is not None:
        np.savez_compressed(save, **kept)


def plot(rows: list[EvaluationRow], file: str) -> None:
    """Medians with their spread, fastest first, against a copy of the array."""
    from matplotlib.figure import Figure

    rows = sorted(rows, key=lambda row: -row.timing.median / row.samples)
    figure = Figure(figsize=(8.0, 0.8 + 0.24 * len(rows)), layout="constrained")
    ax = figure.subplots()
    scale = [1e9 / row.samples for row in rows]
    median = np.array([s * row.timing.median for s, row in zip(scale, rows, strict=True)])
    least = np.array([s * row.timing.least for s, row in zip(scale, rows, strict=True)])
    most = np.array([s * row.timing.most for s, row in zip(scale, rows, strict=True)])
    known = ("trueangle", "error", "correct", "exact", "float32", "16-bit")
    ours = [row.name.startswith(known) for row in rows]
    ax.barh(
        [row.name for row in rows],
        median,
        xerr=[median - least, most - median],
        color=["tab:blue" if own else "tab:gray" for own in ours],
        error_kw={"elinewidth": 1.0, "capsize": 2.0},
    )
    copy = next(m for m, row in zip(median, rows, strict=True) if row.name == "copy float64")
    ax.axvline(copy, color="black", linewidth=0.8, linestyle=":")
    ax.set_xscale("log")
    ax.set_xlabel("ns per sample: median, least and most; dotted: a copy of the array")
    ax.margins(y=0.01)
    ax.grid(axis="x", alpha=0.3)
    figure.savefig(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--peer-rounds", type=int, default=3)
    parser.add_argument("--latency", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--save", metavar="FILE.npz")
    parser.add_argument("--plot", metavar="FILE")
    args = parser.parse_args()
    print(f"python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}")
    path = evaluation.evaluated_model([1])._series.path
    print(f"default path {path}, {args.samples} samples")

    batches = evaluation.evaluate_batches(args.samples, args.rounds)
    show("Batches, ns per sample", batches, "copy float64", "x copy of float64")
    peers, missing = evaluation.evaluate_peers(args.samples, args.peer_rounds)
    show("Peers, 17 orders, ns per sample", peers, "trueangle", "x trueangle")
    for name in missing:
        print(f"  {name:38s} not installed")
    show("37 samples, ns per call", evaluation.evaluate_small(), "error", "x error")
    show("One sample, ns per call with its loop", evaluation.evaluate_single(), "step", "x step")
    if args.plot is not None:
        plot([*batches, *peers], args.plot)
    if args.latency > 0.0:
        latencies(args.latency, args.save)


if __name__ == "__main__":
    main()
