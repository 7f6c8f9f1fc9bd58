"""Correct a long log in memory and print the speed: 1e8 rows with ``--rows 1e8``.

    python examples/long_log.py [--rows 1e6] [--float32]

The log is a joint turning back and forth; its error is known, so that the residual can be
computed. Files of any size go through ``trueangle correct`` in constant memory instead.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import trueangle as ta

MODEL = ta.HarmonicModel(
    [
        ta.Shaft("output", 1, [1, 2], [0.004, 0.001], [0.003, -0.002]),
        ta.Shaft("motor", 100, [1, 2], [0.002, 0.0], [0.001, 0.003]),
    ],
    period=360.0,
)
#: Rows of one piece: what is checked stays in cache.
PIECE = 1 << 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=float, default=1e6)
    parser.add_argument("--float32", action="store_true", help="half the memory, 7 digits")
    args = parser.parse_args()
    rows = int(args.rows)

    kind = np.float32 if args.float32 else np.float64
    true = np.empty(rows, dtype=np.float64)
    for start in range(0, rows, PIECE):
        t = np.arange(start, min(rows, start + PIECE)) * 1e-3
        true[start : start + t.size] = 170.0 * np.sin(0.2 * t)
    indicated = (true + MODEL.error(true)).astype(kind)

    begin = time.perf_counter()
    corrected = MODEL.correct(indicated, out=indicated)
    seconds = time.perf_counter() - begin
    largest = max(
        float(np.abs(corrected[i : i + PIECE] - true[i : i + PIECE]).max())
        for i in range(0, rows, PIECE)
    )
    print(f"{rows} rows in {seconds:.3f} s: {rows / seconds / 1e6:.0f} million rows per second")
    print(f"largest error left: {largest * 3600:.2g} arcsec")


if __name__ == "__main__":
    main()
