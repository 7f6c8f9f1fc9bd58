"""Fit targets: speed against peers, memory beyond the inputs, accuracy against long doubles.

    python benches/fit.py [--large]

Ways are interleaved within one run; ratios of medians are what counts. ``--large`` adds
ten million readings (minutes, 2 GB).
"""

from __future__ import annotations

import argparse
import platform
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from harness.fit import (
    Case,
    FitRow,
    fit_columns,
    fit_peers,
    fit_readings,
    measure_fits,
)
from trueangle import _core


def show(rows: list[FitRow]) -> None:
    case, ours = rows[0].case, rows[0].timing.median
    print(f"\n{case.samples} readings, orders 1..{case.highest}, {case.arc_deg:g} deg")
    for row in rows:
        t = row.timing
        print(
            f"  {row.name:28s} {t.median * 1e3:11.4f} ms"
            f" ({t.least * 1e3:.4f} .. {t.most * 1e3:.4f})"
            f" {t.median / case.samples * 1e9:9.2f} ns each, x {t.median / ours:8.2f}"
            f"   deviation {row.deviation:.1e}"
        )


def peak_memory(case: Case) -> float:
    """Bytes of resident memory that a fit takes beyond its inputs (Linux)."""
    theta, error = fit_readings(case)
    runs = [(theta, theta + error, None)]
    orders = [list(range(1, case.highest + 1))]
    status = Path("/proc/self/status")

    def read(key: str) -> float:
        line = next(line for line in status.read_text().splitlines() if line.startswith(key))
        return 1024.0 * float(line.split()[1])

    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark starts anew
    before = read("VmRSS")
    _core.fit(runs, 2 * np.pi, [1.0], orders)
    return read("VmHWM") - before


def accuracy(arc_deg: float, highest: int, samples: int = 20_000) -> str:
    """Coefficients against least squares refined in 80-bit arithmetic."""
    theta, error = fit_readings(Case(samples, highest, arc_deg))
    indicated = theta + error
    rows = fit_columns(theta, highest)
    wide = theta.astype(np.longdouble)
    exact = [np.ones_like(wide)]
    for k in range(1, highest + 1):
        exact += [np.cos(k * wide), np.sin(k * wide)]
    exact_rows = np.stack(exact, axis=1)
    target = indicated.astype(np.longdouble) - wide
    triangle = np.linalg.qr(rows, mode="r")
    truth = np.zeros(rows.shape[1], np.longdouble)
    for _ in range(8):
        gradient = (exact_rows.T @ (target - exact_rows @ truth)).astype(float)
        truth = truth + np.linalg.solve(triangle, np.linalg.solve(triangle.T, gradient))
    scale = abs(truth).max()
    lstsq = np.linalg.lstsq(rows, indicated - theta)[0]
    text = f"  {arc_deg:3g} deg, {highest:2d} orders, condition {np.linalg.cond(rows):.1e}:"
    text += f" lstsq {float(abs(lstsq - truth).max() / scale):.1e}"
    for method in ("plain", "moments", "qr", None):
        found = _core.fit(
            [(theta, indicated, None)],
            2 * np.pi,
            [1.0],
            [list(range(1, highest + 1))],
            method=method,
        )
        pairs = np.column_stack([found.cosine[0], found.sine[0]]).ravel()
        off = float(abs(pairs - truth[1:]).max() / scale)
        text += f", {method or 'chosen: ' + found.method} {off:.1e}"
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--large", action="store_true", help="ten million readings as well")
    large = parser.parse_args().large
    print(platform.processor() or platform.machine(), "numpy", np.__version__)
    missing = fit_peers()[1]
    if missing:
        print("not installed:", ", ".join(missing))

    fast = ["numpy.linalg.lstsq", "finufft + Toeplitz"]
    show(measure_fits(Case(37, 5), 500, threads=(1,)))
    show(measure_fits(Case(10_000, 17), 15, threads=(1,)))
    show(measure_fits(Case(1_000_000, 17), 5, only=fast, methods=("qr",)))
    if large:
        show(measure_fits(Case(10_000_000, 17), 5, only=fast[1:]))
        show(measure_fits(Case(10_000_000, 17, counts=1 << 16), 5, only=[], methods=("moments",)))
        show(measure_fits(Case(10_000_000, 512), 5, only=fast[1:]))
        show(measure_fits(Case(10_000_000, 8, 180.0), 5, only=[], methods=("moments", "qr")))

    print("\npeak memory beyond the inputs")
    for case in (Case(1_000_000, 17), Case(3_000_000, 17), Case(1_000_000, 512)):
        with get_context("spawn").Pool(1) as fresh:  # a heap that no fit has grown yet
            mega = fresh.apply(peak_memory, (case,)) / 2**20
        print(f"  {case.samples} readings, {case.highest} orders: {mega:.1f} MiB")

    print("\nlargest error of a coefficient, relative to the largest")
    for arc, highest in ((360, 17), (360, 100), (330, 17), (270, 17), (180, 8), (90, 5)):
        print(accuracy(arc, highest))


if __name__ == "__main__":
    main()
