"""Fit of a log of each format, beside what its fastest well-kept reader takes to read both columns.

    python benches/formats.py [--rows 20000000] [--rounds 5] [--only hdf5 ...]

Every way is a process of its own, in turns; medians of seconds and of processor seconds (imports
left out), and their ratios. ``blocks`` reads as a fit does and ``sums`` adds columns that are in
memory, on one thread each: half of both is the least that a fit takes on two processors. Files are
made in a temporary folder and removed.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ORDERS = range(1, 18)
NAMES = ("reference_deg", "indicated_deg")
#: Rows that readers in pieces take at a time.
PIECE = 1 << 20
#: Rows that a fit sums at a time.
BLOCK = 1 << 16
#: Rows of text at most: a file of it is four times as large.
MOST_TEXT = 4_000_000


def columns(rows: int) -> dict[str, np.ndarray]:
    """A joint that moves slowly, with noise."""
    rng = np.random.default_rng(1)
    reference = np.mod(np.cumsum(rng.uniform(0.0, 0.1, rows)), 360.0)
    x = np.radians(reference)
    error = 0.05 * np.cos(x) + 0.01 * np.sin(4 * x) + rng.normal(0.0, 0.001, rows)
    return {"time_s": 1e-3 * np.arange(rows), NAMES[0]: reference, NAMES[1]: reference + error}


def make(kind: str, path: Path, rows: int) -> None:
    """One file of a format."""
    table = columns(min(rows, MOST_TEXT) if kind == "csv" else rows)
    if kind in ("parquet", "arrow", "csv"):
        import pyarrow as pa

        made = pa.table(table)
        if kind == "parquet":
            import pyarrow.parquet as pq

            pq.write_table(made, path, row_group_size=PIECE)
        elif kind == "arrow":
            with pa.ipc.new_file(path, made.schema) as writer:
                writer.write_table(made, max_chunksize=PIECE)
        else:
            import pyarrow.csv

            pyarrow.csv.write_csv(made, path)
    elif kind == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            for name, values in table.items():
                file.create_dataset(name, data=values, chunks=(min(values.size, 1 << 16),))
    else:
        from asammdf import MDF, Signal

        time_s = table.pop("time_s")
        with MDF(version="4.10") as file:
            file.append([Signal(v, time_s, name=name, unit="deg") for name, v in table.items()])
            file.save(path)


def read_parquet(path: Path) -> None:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        for group in range(file.num_row_groups):
            file.read_row_group(group, columns=list(NAMES))


def read_arrow(path: Path) -> None:
    import pyarrow as pa

    with pa.OSFile(str(path)) as file:
        schema = pa.ipc.open_file(file).schema
        wanted = [schema.get_field_index(name) for name in NAMES]
        # The third column is not read. Threads gain nothing for two columns.
        options = pa.ipc.IpcReadOptions(included_fields=wanted, use_threads=False)
        with pa.ipc.open_file(file, options=options) as reader:
            for i in range(reader.num_record_batches):
                reader.get_batch(i)


def read_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path) as file:
        for start in range(0, file[NAMES[0]].size, PIECE):
            for name in NAMES:
                file[name][start : start + PIECE]


def read_mdf4(path: Path) -> None:
    from asammdf import MDF

    with MDF(path) as file:
        for _ in file.select(list(NAMES), raw=True):
            pass


def read_csv(path: Path) -> None:
    import polars

    polars.read_csv(path, columns=list(NAMES))


def read_csv_pyarrow(path: Path) -> None:
    import pyarrow.csv

    options = pyarrow.csv.ConvertOptions(include_columns=list(NAMES))
    for _ in pyarrow.csv.open_csv(path, convert_options=options):
        pass


def fit(path: Path) -> None:
    import trueangle as ta

    ta.fit_logs(path, ORDERS, progress="none")


def blocks(path: Path) -> None:
    from trueangle.formats.formats import find_format

    kind = find_format(path)

    def read() -> None:
        for part in kind.stretches(path):
            for _ in kind.read(path, list(NAMES), None, part, texts=()):
                pass

    # Threads keep freed memory; the main one, with little else, gives it back block by block.
    with ThreadPoolExecutor(1) as pool:
        pool.submit(read).result()


def sums(table: dict[str, np.ndarray]) -> None:
    import trueangle as ta

    moments, travel = ta.Moments(ORDERS, period=360.0), np.zeros(360, dtype=np.int64)
    for start in range(0, table[NAMES[0]].size, BLOCK):
        reference, indicated = (table[name][start : start + BLOCK] for name in NAMES)
        moments.update_known(reference, indicated, travel=travel)


#: What a fit takes apart, on one thread.
PARTS = ("blocks", "sums")
#: Readers by format; the ratio is to the fastest.
READERS = {
    "parquet": {"pyarrow": read_parquet},
    "arrow": {"pyarrow": read_arrow},
    "hdf5": {"h5py": read_hdf5},
    "mf4": {"asammdf": read_mdf4},
    "csv": {"polars": read_csv, "pyarrow": read_csv_pyarrow},
}


def measured(kind: str, way: str, path: Path, rows: int) -> dict[str, float]:
    """Seconds of one way in a process of its own."""
    command = [sys.executable, __file__, "--way", way, "--only", kind, "--path", str(path)]
    command += ["--rows", str(rows)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result: dict[str, float] = json.loads(done.stdout)
    return result


def used() -> float:
    """Processor seconds of this process."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=20_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=READERS, default=list(READERS))
    parser.add_argument("--way", help=argparse.SUPPRESS)
    parser.add_argument("--path", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.way:
        way = {"fit": fit, "blocks": blocks, **READERS[args.only[0]]}.get(args.way)
        if way is None:
            table = columns(min(args.rows, MOST_TEXT) if args.only[0] == "csv" else args.rows)

            def way(_: Path) -> None:
                sums(table)

        with tempfile.TemporaryDirectory() as name:  # what is imported at the first file
            first = Path(name, f"first.{args.only[0]}")
            make(args.only[0], first, 20_000)
            way(first)
        start, before = time.perf_counter(), used()
        way(args.path)
        taken = {"seconds": time.perf_counter() - start, "processor": used() - before}
        print(json.dumps(taken))
        return
    print(f"{'':10}{'way':10}{'s':>8}{'least':>8}{'core s':>8}{'x read':>8}{'x core':>8}")
    for kind in args.only:
        with tempfile.TemporaryDirectory() as name:
            path = Path(name, f"log.{kind}")
            make(kind, path, args.rows)
            ways = [*READERS[kind], "fit", *PARTS]
            found: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
            for _ in range(args.rounds):
                for way in ways:
                    found[way].append(measured(kind, way, path, args.rows))
        median = {
            way: {k: statistics.median(one[k] for one in runs) for k in runs[0]}
            for way, runs in found.items()
        }
        best = min(READERS[kind], key=lambda way: median[way]["seconds"])
        for way in ways:
            seconds, cores = median[way]["seconds"], median[way]["processor"]
            least = min(one["seconds"] for one in found[way])
            print(
                f"{kind:10}{way:10}{seconds:8.2f}{least:8.2f}{cores:8.2f}"
                f"{seconds / median[best]['seconds']:8.2f}"
                f"{cores / median[best]['processor']:8.2f}"
            )


if __name__ == "__main__":
    main()
