"""Numbers that are read where they lie in a file, without the library of its format."""

from pathlib import Path

import numpy as np
import pytest

from trueangle.errors import FileError
from trueangle.formats import stored

h5py = pytest.importorskip("h5py")
from trueangle.formats import hdf5  # noqa: E402
from trueangle.formats.hdf5places import Places  # noqa: E402

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
    "in another file": ({}, "<f8", False),
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
        if layout == "in another file":
            options = {"external": [(f"{path}.raw", 0, h5py.h5f.UNLIMITED)]}
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
        assert (Places.of(file["a"], range(ROWS)) is not None) == LAYOUTS[layout][2]
    for parts in ([None], [hdf5.Part(i, PARTS) for i in range(PARTS)]):
        batches = [batch for part in parts for batch in hdf5.read(path, ["a", "b"], None, part)]
        found = np.concatenate([batch["a"] for batch in batches])
        np.testing.assert_array_equal(found, wanted)
        assert found.dtype.isnative
        other = np.concatenate([batch["b"] for batch in batches])
        np.testing.assert_array_equal(other, np.arange(ROWS))


def test_a_file_that_is_cut_short_while_it_is_read_is_told(tmp_path: Path):
    path = tmp_path / "log.h5"
    made(path, "in one piece")
    batches = hdf5.read(path, ["a", "b"])
    next(batches)
    with path.open("r+b") as file:
        file.truncate(20_000)
    with pytest.raises(FileError, match=r"log\.h5: is damaged or not HDF5: it ends \d+ bytes"):
        list(batches)


def test_the_end_of_a_file_is_no_number(tmp_path: Path):
    path = tmp_path / "numbers"
    np.arange(10.0).tofile(path)
    with path.open("rb", buffering=0) as file:
        np.testing.assert_array_equal(stored.stored_values(file, 16, "<f8", 3), [2.0, 3.0, 4.0])
        assert stored.stored_values(file, 80, "<f8", 0).size == 0
        with pytest.raises(OSError, match="it ends 8 bytes before"):
            stored.stored_values(file, 72, "<f8", 2)
