"""Small files that unpack to much: refused before the memory is taken, by one budget for all."""

import re
import time
import zipfile

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.formats import budget
from trueangle.formats.format import Selection
from trueangle.runs import readings

#: The budget of these tests, and rows that go beyond it in two columns of numbers.
SMALL, ROWS = 1 << 20, 100_000

NAMES = ("reference_deg", "indicated_deg")


def zeros():
    return {name: np.zeros(ROWS) for name in (*NAMES, "x")}


def _npz(path):
    np.savez_compressed(path, **zeros())


def _hdf5(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in zeros().items():
            file.create_dataset(name, data=values, compression="gzip")


def _parquet(path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    pq.write_table(pa.table(zeros()), path, compression="zstd")


def _arrow(path):
    pa = pytest.importorskip("pyarrow")
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    table = pa.table(zeros())
    new = pa.ipc.new_stream if path.suffix == ".arrows" else pa.ipc.new_file
    with pa.OSFile(str(path), "wb") as file, new(file, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=ROWS)


def _matlab(path):
    io = pytest.importorskip("scipy.io")
    io.savemat(path, {k: v[:, None] for k, v in zeros().items()}, do_compression=True)


def _csv(path):
    path.write_text(",".join([*NAMES, "x"]) + "\n" + "0,0,0\n" * ROWS)


WRITERS = {
    "a.npz": _npz,
    "a.h5": _hdf5,
    "a.parquet": _parquet,
    "a.arrow": _arrow,
    "a.arrows": _arrow,
    "a.mat": _matlab,
    "a.csv": _csv,
}


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(budget, "DECODED_BYTES", SMALL)


@pytest.mark.parametrize("name", WRITERS)
def test_what_unpacks_to_more_than_the_budget_is_refused(name, small, tmp_path, monkeypatch):
    path = tmp_path / name
    WRITERS[name](path)
    assert path.stat().st_size < SMALL
    if name != "a.csv":  # asked of what the file says, before anything is unpacked

        def unpacked(*_args):
            raise AssertionError("was unpacked")

        monkeypatch.setattr(readings, "_joined", unpacked)
    with pytest.raises(ta.errors.FileError, match="MiB") as told:
        ta.read_runs(path)
    assert name in str(told.value)
    assert re.search("fit_logs|-v7.3|smaller", str(told.value))


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "a.parquet", "a.csv"])
def test_columns_of_which_nothing_is_known_are_left_out_first(name, tmp_path, monkeypatch):
    """The angles alone are within the budget: they are read."""
    path = tmp_path / name
    WRITERS[name](path)
    monkeypatch.setattr(budget, "DECODED_BYTES", 20 * ROWS)
    (run,) = ta.read_runs(path)
    assert len(run) == ROWS
    assert "x" not in run.columns
    monkeypatch.setattr(budget, "DECODED_BYTES", 30 * ROWS)
    (run,) = ta.read_runs(path)
    assert "x" in run.columns


def test_a_data_set_of_which_nothing_is_stored_is_refused(tmp_path, capsys):
    """A file of kilobytes: neither fitted nor copied out until the disk is full."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name in NAMES:
            file.create_dataset(name, (10**10,), "f8", chunks=(1 << 16,))
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    ta.HarmonicModel([shaft], period=360.0).save(tmp_path / "m.json")
    model, out = str(tmp_path / "m.json"), str(tmp_path / "out.h5")
    start = time.process_time()
    for command in (
        ["fit", str(path), "-o", out.replace("h5", "json")],
        ["fit", str(path), "--one-pass", "-o", out.replace("h5", "json")],
        ["check", str(path)],
        ["correct", str(path), "-m", model, "-o", out],
    ):
        assert main(command) == 1
        told = capsys.readouterr().err
        assert told.count("\n") == 1, told
        assert "a.h5" in told
    assert "0 % of them are stored" in told
    assert time.process_time() - start < 20.0  # nothing of it was computed: that takes minutes
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5", "m.json"]


@pytest.mark.parametrize(
    ("chunks", "stored", "told"),
    [
        *[(True, 1.0, None), (True, 0.6, None), (True, 0.4, "40 %"), (True, 0.0, "0 %")],
        *[(False, 1.0, None), (False, 0.0, "0 %")],
    ],
)
def test_a_large_data_set_is_read_where_half_of_it_is_stored(
    chunks, stored, told, monkeypatch, tmp_path
):
    """Of one without chunks all or nothing is there."""
    h5py = pytest.importorskip("h5py")
    from trueangle.formats import hdf5

    monkeypatch.setattr(budget, "DECODED_BYTES", 40_000)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        made = file.create_dataset("x", (10_000,), "f8", chunks=(1000,) if chunks else None)
        if stored:
            made[: int(10_000 * stored)] = 1.0
    selection = Selection(["x"])
    if told is None:
        assert sum(part["x"].size for part in hdf5.read(tmp_path / "a.h5", selection)) == 10_000
        return
    with pytest.raises(FileError, match=f"declares 10000 values, but {told} of them are stored"):
        list(hdf5.read(tmp_path / "a.h5", selection))


def test_a_record_batch_is_not_unpacked_to_be_corrected(small, tmp_path):
    pytest.importorskip("pyarrow")
    _arrow(tmp_path / "a.arrow")
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    model = ta.HarmonicModel([shaft], period=360.0)
    report = ta.correct_logs(tmp_path / "a.arrow", model, tmp_path / "b.arrow")
    assert "record batch unpacks to" in str(report.logs[0].error)
    with pytest.raises(ta.errors.FileError, match="record batch unpacks to"):
        ta.fit_logs(tmp_path / "a.arrow", orders=[1])


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "a.mat"])
@pytest.mark.parametrize("other", [ROWS - 1, 1])
def test_columns_of_unlike_lengths_are_refused_by_every_reader(name, other, tmp_path, capsys):
    path = tmp_path / name
    given = {
        "reference_deg": np.linspace(0.0, 359.0, ROWS),
        "indicated_deg": np.zeros(max(other, 2)),
    }
    if name == "a.npz":
        np.savez(path, **given)
    elif name == "a.h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for key, values in given.items():
                file[key] = values
    else:
        io = pytest.importorskip("scipy.io")
        io.savemat(path, {key: values[:, None] for key, values in given.items()})
    out = str(tmp_path / "x.json")
    for command in (
        ["check", str(path)],
        ["fit", str(path), "-o", out],
        ["fit", str(path), "--one-pass", "-o", out],
        ["orders", str(path)],
    ):
        assert main(command) == 1, command
        told = capsys.readouterr().err
        assert "differ in length" in told, (command, told)
        assert told.count("\n") == 1


def test_an_archive_whose_header_says_more_than_it_holds(tmp_path):
    """The size is asked of the header: refused before anything is read."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in NAMES:
            with archive.open(f"{name}.npy", "w") as file:
                shape = (10**12,)
                told = {"descr": "<f8", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, told)
    with pytest.raises(ta.errors.FileError, match=r"unpacks to 1.49e\+04 GiB"):
        ta.read_runs(tmp_path / "a.npz")
