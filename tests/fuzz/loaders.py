"""What is fuzzed: every loader whose libraries are installed."""

from __future__ import annotations

import importlib.util
import random
from pathlib import Path
from typing import Any

from arrays import matlab4, matlab5, npy, npz
from channels import mdf4
from columnar import arrow, hdf5, parquet
from documents import documents
from loader import ROWS, Loader, columns, damaged, use_both, use_log, use_runs, written_loader
from pen import Pen, penned
from robotlogs import bag1, mcap, sqlite_bag, wpilog
from texts import texts

#: Fields of a small Parquet file, about.
_FIELDS = 700


def _arrow_table(rng: random.Random) -> Any:
    import pyarrow as pa

    made = {name: pa.array(values) for name, values in columns().items()}
    kinds = (
        pa.bool_(),
        pa.string(),
        pa.large_string(),
        pa.binary(),
        pa.float16(),
        pa.float32(),
        pa.int8(),
        pa.uint64(),
        pa.decimal128(38, 3),
        pa.decimal256(60, 3),
        pa.time64("us"),
        pa.duration("s"),
        pa.timestamp("ms", "UTC"),
        pa.large_list(pa.float64()),
        pa.list_(pa.float64(), 2),
        pa.map_(pa.string(), pa.float64()),
        pa.binary(3),
        pa.timestamp("ns"),
        pa.date32(),
        pa.null(),
        pa.list_(pa.float64()),
        pa.struct([("x", pa.float64())]),
        pa.dictionary(pa.int32(), pa.string()),
        pa.dictionary(pa.int8(), pa.float64()),
    )
    for _ in range(rng.choice((0, 1, 1, 2))):
        name = rng.choice(list(made))
        kind = rng.choice(kinds)
        try:
            made[name] = made[name].cast(kind)
        except (pa.ArrowException, NotImplementedError):
            values = [None if v is None else rng.choice((None, v)) for v in made[name].to_pylist()]
            made[name] = pa.nulls(ROWS, kind) if rng.random() < 0.5 else pa.array(values)
    names = list(made)
    if rng.random() < 0.15:
        names[rng.randrange(len(names))] = rng.choice(("", "a/b", "reference_rad", names[0]))
    return pa.table(list(made.values()), names=names)


def _make_parquet(folder: Path, rng: random.Random) -> Path:
    import pyarrow.parquet as pq

    path = folder / "runs.parquet"
    try:
        pq.write_table(
            _arrow_table(rng),
            path,
            row_group_size=rng.choice((7, 20, 100)),
            compression=rng.choice(("none", "snappy", "zstd")),
            use_dictionary=rng.random() < 0.5,
            data_page_version=rng.choice(("1.0", "1.0", "2.0")),
            store_schema=rng.random() < 0.7,
        )
    except Exception:
        pq.write_table(_arrow_table(random.Random(0)), path)
    how = rng.random()
    if how < 0.6:
        hits = frozenset(rng.randint(1, _FIELDS) for _ in range(rng.choice((1, 2, 4))))
        path.write_bytes(parquet(Pen(rng, hits), path.read_bytes()))
    return damaged(path, rng, always=True) if how > 0.9 else path


def _make_arrow(folder: Path, rng: random.Random) -> Path:
    import pyarrow as pa

    path = folder / "log.arrow"
    table = _arrow_table(rng)
    new = rng.choice((pa.ipc.new_file, pa.ipc.new_stream))
    options = pa.ipc.IpcWriteOptions(compression=rng.choice((None, None, "lz4", "zstd")))
    with pa.OSFile(str(path), "wb") as file, new(file, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=rng.choice((16, 100)))
    how = rng.random()
    if how < 0.6:
        path.write_bytes(arrow(path.read_bytes(), rng))
    return damaged(path, rng, always=True) if how > 0.9 else path


def _make_hdf5(folder: Path, rng: random.Random) -> Path:
    path = folder / f"log{rng.choice(('.h5', '.h5', '.mat', '.nc'))}"
    hdf5(path, columns(), rng)
    return damaged(path, rng, always=True) if rng.random() > 0.9 else path


def _make_sqlite(folder: Path, rng: random.Random) -> Path:
    path = folder / "log.db3"
    penned("db3", lambda pen, variant: sqlite_bag(pen, variant, path), 1, rng)
    return damaged(path, rng, always=True) if rng.random() > 0.9 else path


def _has(*modules: str) -> bool:
    return all(importlib.util.find_spec(module) is not None for module in modules)


def loaders() -> dict[str, Loader]:
    """Every loader whose libraries are installed."""
    found = [*documents(), *texts()]
    if _has("pyarrow"):
        found += [
            Loader("runs-parquet", _make_parquet, use_runs),
            Loader("log-parquet", _make_parquet, use_log),
            Loader("log-arrow", _make_arrow, use_both),
        ]
    if _has("h5py"):
        found += [Loader("log-hdf5", _make_hdf5, use_both)]
    found += [
        written_loader("runs-npz", ".npz", npz, 2, use_runs),
        written_loader("log-npz", ".npz", npz, 2, use_log),
        written_loader("log-npy", ".npy", npy, 3, use_both),
        written_loader("log-wpilog", ".wpilog", wpilog, 2, use_both),
    ]
    if _has("scipy"):
        found += [
            written_loader("log-matlab4", ".mat", matlab4, 2, use_both),
            written_loader("log-matlab", ".mat", matlab5, 4, use_both),
        ]
    if _has("asammdf"):
        found += [written_loader("log-mdf", ".mf4", mdf4, 6, use_both)]
    if _has("rosbags"):
        found += [
            written_loader("log-bag", ".bag", bag1, 3, use_log),
            Loader("log-db3", _make_sqlite, use_log),
            written_loader("log-mcap", ".mcap", mcap, 4, use_log),
        ]
    return {loader.name: loader for loader in found}
