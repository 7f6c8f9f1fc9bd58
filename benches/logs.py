"""Correct and fit logs end to end, against peers and the disk; every way in a process of its own.

    python benches/logs.py [--rows 20000000] [--files 4] [--folder DIR]

Prints median and least seconds, median seconds of all cores, rows per second and peak memory
(of the process, interpreter included). Files are made in DIR (default: a temporary folder) and
removed. Slow ways get fewer rows.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ORDERS = range(1, 18)
#: Rows of ways that take too long, or too much memory, for all of them.
FEWER = {"pandas loop": 100_000, "numpy": 5_000_000, "polars": 5_000_000, "duckdb": 2_000_000}
_MEDIANS = ("seconds", "cores")


def made_model():
    import trueangle as ta

    rng = np.random.default_rng(0)
    a, b = rng.normal(0.0, 0.01, (2, len(ORDERS)))
    return ta.HarmonicModel([ta.Shaft("output", 1, ORDERS, a, b)], period=360.0)


def make(folder: Path, rows: int, files: int) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    rng, model = np.random.default_rng(1), made_model()
    for i in range(files):
        schema = pa.schema([("reference_deg", pa.float64()), ("indicated_deg", pa.float64())])
        with pq.ParquetWriter(folder / f"{i:03d}.parquet", schema) as writer:
            for start in range(0, rows // files, 1 << 20):
                count = min(1 << 20, rows // files - start)
                theta = np.mod(np.cumsum(rng.uniform(0.0, 0.1, count)), 360.0)
                said = theta + model.error(theta) + rng.normal(0.0, 0.001, count)
                writer.write_table(pa.table([theta, said], schema=schema))


def rewrite(folder, out):
    """What pyarrow alone takes to read and rewrite the same files."""
    import pyarrow.parquet as pq

    for path in sorted(folder.glob("*.parquet")):
        with (
            pq.ParquetFile(path) as file,
            pq.ParquetWriter(out / path.name, file.schema_arrow) as writer,
        ):
            for group in range(file.num_row_groups):
                writer.write_table(file.read_row_group(group))


def scan(folder, out):
    """What pyarrow takes to read both columns."""
    import pyarrow.parquet as pq

    for path in sorted(folder.glob("*.parquet")):
        with pq.ParquetFile(path) as file:
            for group in range(file.num_row_groups):
                file.read_row_group(group)


def correct(folder, out):
    import trueangle as ta

    assert ta.correct_logs(folder, made_model(), out / "corrected").is_done


def fit(folder, out):
    import trueangle as ta

    ta.fit_logs(folder, ORDERS)


def _sum(x, xp, model):
    total = model.constant
    (shaft,) = model.shafts
    for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
        total = total + a * xp.cos(k * x) + b * xp.sin(k * x)
    return total


def with_numpy(folder, out):
    """Whole file in memory, numpy per order, one Newton step left out: indicated argument."""
    import pyarrow.parquet as pq

    model = made_model()
    for path in sorted(folder.glob("*.parquet")):
        table = pq.read_table(path)
        x = table["indicated_deg"].to_numpy()
        corrected = x - _sum(np.radians(x), np, model)
        pq.write_table(table.append_column("corrected_deg", [corrected]), out / path.name)


def with_pandas(folder, out):
    """A loop over rows."""
    import math

    import pandas as pd

    model = made_model()
    for path in sorted(folder.glob("*.parquet")):
        frame = pd.read_parquet(path)
        frame["corrected_deg"] = [
            row.indicated_deg - _sum(math.radians(row.indicated_deg), math, model)
            for row in frame.itertuples()
        ]
        frame.to_parquet(out / path.name)


def with_polars(folder, out):
    import polars as pl

    model = made_model()
    x = pl.col("indicated_deg").radians()
    (shaft,) = model.shafts
    error = sum(
        a * (k * x).cos() + b * (k * x).sin()
        for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True)
    )
    for path in sorted(folder.glob("*.parquet")):
        lazy = pl.scan_parquet(path)
        lazy = lazy.with_columns((pl.col("indicated_deg") - error).alias("corrected_deg"))
        lazy.sink_parquet(out / path.name)


def with_duckdb(folder, out):
    import duckdb

    model = made_model()
    (shaft,) = model.shafts
    error = " + ".join(
        f"{a!r} * cos({k} * radians(indicated_deg)) + {b!r} * sin({k} * radians(indicated_deg))"
        for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True)
    )
    for path in sorted(folder.glob("*.parquet")):
        duckdb.sql(
            f"copy (select *, indicated_deg - ({error}) as corrected_deg from '{path}') "
            f"to '{out / path.name}' (format parquet)"
        )


def cat(folder, out):
    with open(os.devnull, "wb") as nowhere:
        subprocess.run(["cat", *map(str, folder.glob("*.parquet"))], stdout=nowhere, check=True)


def copy(folder, out):
    shutil.copytree(folder, out / "copy")


WAYS = {
    "cat to /dev/null": cat,
    "copy": copy,
    "pyarrow read": scan,
    "trueangle fit": fit,
    "pyarrow read, rewrite": rewrite,
    "trueangle correct": correct,
    "polars": with_polars,
    "numpy": with_numpy,
    "duckdb": with_duckdb,
    "pandas loop": with_pandas,
}


def measured(way: str, folder: Path) -> dict[str, float]:
    """Seconds and peak MB of one way, in a process of its own."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as out:
        done = subprocess.run(
            [sys.executable, __file__, "--way", way, "--folder", str(folder), "--out", out],
            capture_output=True,
            text=True,
            check=True,
        )
    result: dict[str, float] = json.loads(done.stdout)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=20_000_000)
    parser.add_argument("--files", type=int, default=4)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--only", action="append", choices=WAYS)
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.way:
        start = time.perf_counter()
        WAYS[args.way](args.folder, args.out)
        seconds = time.perf_counter() - start
        used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        cores = sum(one.ru_utime + one.ru_stime for one in used)
        # Not ru_maxrss: that of the process which started this one counts in it.
        status = Path("/proc/self/status").read_text()
        peak = int(status.partition("VmHWM:")[2].split()[0]) / 1024.0
        print(json.dumps({"seconds": seconds, "cores": cores, "megabytes": peak}))
        return
    with tempfile.TemporaryDirectory(dir=args.folder) as made:
        folders: dict[int, Path] = {}
        print(
            f"{'way':<24}{'rows':>12}{'s':>9}{'least':>9}{'core s':>9}{'rows/s':>11}{'ns/row':>9}"
            f"{'peak MB':>9}"
        )
        ways = args.only or list(WAYS)
        runs: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
        for _ in range(args.repeat):  # interleaved: all ways see the same noise
            for way in ways:
                rows = min(args.rows, FEWER.get(way, args.rows))
                if rows not in folders:
                    folders[rows] = Path(made, str(rows), "logs")
                    folders[rows].mkdir(parents=True)
                    make(folders[rows], rows, args.files)
                runs[way].append(measured(way, folders[rows]))
        for way, found in runs.items():
            rows = min(args.rows, FEWER.get(way, args.rows)) // args.files * args.files
            seconds, cores = (float(np.median([one[k] for one in found])) for k in _MEDIANS)
            least = min(one["seconds"] for one in found)
            peak = max(one["megabytes"] for one in found)
            print(
                f"{way:<24}{rows:>12}{seconds:>9.2f}{least:>9.2f}{cores:>9.2f}"
                f"{rows / seconds:>11.3g}{seconds / rows * 1e9:>9.1f}{peak:>9.0f}"
            )


if __name__ == "__main__":
    main()
