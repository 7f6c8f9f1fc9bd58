"""Numbers that are read where they lie in a file, without the library of its format."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueangle.errors import FileError
from trueangle.formats import stored
from trueangle.formats.format import Selection
from trueangle.formats.stored import Checksum

h5py = pytest.importorskip("h5py")
pa = pytest.importorskip("pyarrow")
from trueangle.formats import arrow, hdf5  # noqa: E402
from trueangle.formats.arrow import placed_batch  # noqa: E402
from trueangle.formats.arrowtables import arrow_numbers  # noqa: E402
from trueangle.formats.hdf5sets import Hdf5Places  # noqa: E402

ROWS = 30_001
PARTS = 3

#: How a data set is stored, its type, and whether it is read without the library.
LAYOUTS = {
    "in one piece": ({}, "<f8", True),
    "in whole chunks": ({"chunks": (8192,)}, "<f8", True),
    "in odd chunks": ({"chunks": (10_007,)}, "<f4", True),
    "big-endian": ({}, ">f8", True),
    "whole numbers": ({"chunks": (8192,)}, "<u2", True),
    "big-endian whole numbers": ({}, ">i4", True),
    "in small chunks": ({"chunks": (100,)}, "<f8", False),
    "packed": ({"chunks": (8192,), "compression": "gzip"}, "<f8", False),
    "behind a user block": ({"chunks": (8192,)}, "<f8", False),
    "partly never written": ({"chunks": (8192,)}, "<f8", False),
}


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr("trueangle.formats.hdf5.ROWS", 999)


def made(path: Path, layout: str) -> np.ndarray:
    options, kind, _ = LAYOUTS[layout]
    values = np.random.default_rng(11).normal(0.0, 100.0, ROWS)
    values = np.abs(values).astype(kind) if kind == "<u2" else values.astype(kind)
    with h5py.File(path, "w", userblock_size=512 * ("user block" in layout)) as file:
        if layout == "partly never written":
            values[9000:] = 7.0
            data = file.create_dataset("a", (ROWS,), kind, fillvalue=7.0, **options)
            data[:9000] = values[:9000]
        else:
            file.create_dataset("a", data=values, **options)
        file.create_dataset("b", data=np.arange(float(ROWS)))
    return values


@pytest.mark.parametrize("layout", LAYOUTS)
def test_values_are_those_of_the_library(layout: str, tmp_path: Path):
    path = tmp_path / "log.h5"
    wanted = made(path, layout)
    with h5py.File(path) as file:
        assert (Hdf5Places.of(file["a"], range(ROWS)) is not None) == LAYOUTS[layout][2]
    for parts in ([None], [hdf5.RowRange(i, PARTS) for i in range(PARTS)]):
        batches = [
            batch
            for part in parts
            for batch in hdf5.read(path, Selection(["a", "b"], stretch=part))
        ]
        found = np.concatenate([batch["a"] for batch in batches])
        np.testing.assert_array_equal(found, wanted)
        assert found.dtype.isnative
        other = np.concatenate([batch["b"] for batch in batches])
        np.testing.assert_array_equal(other, np.arange(ROWS))


def test_a_file_that_is_cut_short_while_it_is_read_is_told(tmp_path: Path):
    path = tmp_path / "log.h5"
    made(path, "in one piece")
    batches = hdf5.read(path, Selection(["a", "b"]))
    next(batches)
    with path.open("r+b") as file:
        file.truncate(20_000)
    with pytest.raises(FileError, match=r"log\.h5: is damaged or not HDF5: it ends \d+ bytes"):
        list(batches)


@pytest.mark.parametrize("chunk", [1, 700, ROWS])
@pytest.mark.parametrize("size", [1, 699, ROWS])
def test_the_first_part_has_the_first_row_and_parts_are_even(size: int, chunk: int, tmp_path: Path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        data = file.create_dataset("a", (size,), "f8", chunks=(min(chunk, size),))
        rows = [hdf5.RowRange(i, PARTS).rows(size, [data]) for i in range(PARTS)]
    assert [row for part in rows for row in part] == list(range(size))
    assert rows[0].start == 0 < len(rows[0])
    assert max(map(len, rows)) - min(map(len, rows)) < 2 * chunk  # the last may be shorter


def made_arrow(path: Path, *, nulls: bool = False, **options: object) -> pa.Table:
    """Three batches of many types, those that are read in place among them."""
    rng = np.random.default_rng(12)
    missing = rng.uniform(size=ROWS) < 0.2 if nulls else None
    columns = {
        "text": pa.array([f"row {i}" for i in range(ROWS)]),
        "nothing": pa.nulls(ROWS),
        "moving": pa.array(rng.uniform(size=ROWS) < 0.5),
        "a": pa.array(rng.normal(size=ROWS), mask=missing),
        "time": pa.array(np.arange(ROWS), pa.timestamp("us")),
        "count": pa.array(rng.integers(0, 60_000, ROWS).astype(np.uint16), mask=missing),
        "short": pa.array(rng.normal(size=ROWS).astype(np.float32)),
        "label": pa.array(["x", "y", "z"] * (ROWS // 3) + ["x"]).dictionary_encode(),
    }
    table = pa.table(columns)
    with pa.ipc.new_file(path, table.schema, **options) as writer:
        writer.write_table(table, max_chunksize=12_001)
    return table


def arrow_read(path: Path, names: list[str], parts: int) -> dict[str, np.ndarray]:
    batches = [
        batch
        for number in range(3)
        for part in range(parts)
        for batch in arrow.read(
            path,
            Selection(names, stretch=arrow.BatchRange(range(number, number + 1), part, parts)),
        )
    ]
    return {name: np.concatenate([batch[name] for batch in batches]) for name in names}


@pytest.mark.parametrize("parts", [1, PARTS])
@pytest.mark.parametrize("nulls", [False, True])
@pytest.mark.parametrize("compression", [None, "lz4"])
def test_columns_are_those_of_pyarrow(
    compression: str | None, nulls: bool, parts: int, tmp_path: Path, monkeypatch
):
    monkeypatch.setattr("trueangle.formats.arrow.ROWS", 997)
    path = tmp_path / "log.arrow"
    table = made_arrow(path, nulls=nulls, options=pa.ipc.IpcWriteOptions(compression=compression))
    names = ["short", "a", "count"]
    with pa.memory_map(str(path)) as mapped:
        placed = placed_batch(mapped, pa.ipc.open_file(mapped).get_batch(1), names)
    assert (placed is None) == (compression is not None)
    found = arrow_read(path, names, parts)
    for name in names:
        np.testing.assert_array_equal(found[name], arrow_numbers(path, name, table[name]))


def test_labels_and_columns_that_lie_elsewhere_are_left_to_pyarrow(tmp_path: Path):
    path = tmp_path / "log.arrow"
    table = made_arrow(path)
    with pa.memory_map(str(path)) as mapped:
        batch = pa.ipc.open_file(mapped).get_batch(0)
        assert placed_batch(mapped, batch, ["a", "count"]) is not None
        for name in ("label", "text", "moving", "nothing"):
            assert placed_batch(mapped, batch, ["a", name]) is None
        # What lies elsewhere: in memory, or behind a shifted start.
        assert placed_batch(mapped, table.to_batches()[0], ["a"]) is None
        assert placed_batch(mapped, batch.slice(5), ["a"]) is None
    wanted = arrow_numbers(path, "a", table["a"])
    batches = list(arrow.read(path, Selection(["a", "label"], stretch=arrow.BatchRange(range(3)))))
    np.testing.assert_array_equal(np.concatenate([batch["a"] for batch in batches]), wanted)


def test_a_column_that_is_there_twice_is_left_to_pyarrow(tmp_path: Path):
    path = tmp_path / "log.arrow"
    column = pa.array(np.arange(50.0))
    table = pa.Table.from_arrays([column, column], ["a", "a"])
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table)
    with pa.memory_map(str(path)) as mapped:
        assert placed_batch(mapped, pa.ipc.open_file(mapped).get_batch(0), ["a"]) is None


def test_an_arrow_file_that_is_cut_short_while_it_is_read_is_told(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("trueangle.formats.arrow.ROWS", 997)
    path = tmp_path / "log.arrow"
    made_arrow(path)
    batches = arrow.read(path, Selection(["a"], stretch=arrow.BatchRange(range(3))))
    next(batches)
    with path.open("r+b") as file:
        file.truncate(9000)
    with pytest.raises(FileError, match=r"log\.arrow: is damaged or not Arrow: it ends"):
        list(batches)


def test_the_end_of_a_file_is_no_number(tmp_path: Path):
    path = tmp_path / "numbers"
    np.arange(10.0).tofile(path)
    with path.open("rb", buffering=0) as file:
        np.testing.assert_array_equal(stored.stored_values(file, 16, "<f8", 3), [2.0, 3.0, 4.0])
        assert stored.stored_values(file, 80, "<f8", 0).size == 0
        with pytest.raises(OSError, match="it ends 8 bytes before"):
            stored.stored_values(file, 72, "<f8", 2)


def checksum(*parts):
    found = Checksum()
    for part in parts:
        found.update(part)
    return found.text()


def slow(values):
    """The definition, in Python integers."""
    words = values.view(np.uint64).tolist()
    placed = sum(i * w for i, w in enumerate(words, 1))
    return f"{len(words)}:{sum(words) % 2**64:016x}:{placed % 2**64:016x}"


@given(st.integers(0, 200_000), st.lists(st.floats(0, 1), max_size=3), st.integers(0, 2**32 - 1))
def test_cuts_do_not_matter_and_the_sums_are_those_defined(rows, cuts, seed):
    values = np.random.default_rng(seed).normal(size=rows)
    parts = np.split(values, sorted(int(cut * rows) for cut in cuts))
    assert checksum(*parts) == checksum(values)
    if rows < 2000:
        assert checksum(values) == slow(values)


DAMAGE = {
    "a bit": lambda v: np.concatenate([v[:5], np.nextafter(v[5:6], 9.0), v[6:]]),
    "two exchanged": lambda v: v[[1, 0, *range(2, v.size)]],
    "one lost": lambda v: v[:-1],
    "one doubled": lambda v: np.concatenate([v, v[-1:]]),
    "one zeroed": lambda v: np.where(np.arange(v.size) == 3, 0.0, v),
    "sign of zero": lambda v: np.where(v == 0.0, -0.0, v),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_shows(damage):
    values = np.concatenate([np.random.default_rng(3).normal(size=1000), [0.0, np.nan]])
    assert checksum(DAMAGE[damage](values)) != checksum(values)
    assert checksum(values.copy()) == checksum(values)


@pytest.mark.parametrize("kind", [np.int8, np.uint16, np.float32, np.int64, np.complex128])
def test_items_of_any_width(kind):
    values = np.arange(100).astype(kind)
    assert checksum(values) == checksum(values[:30], values[30:])
    assert checksum(values) != checksum(values[::-1])
