"""What every format promises of its files, asked of all of them with one table."""

import json
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.formats.format import CopyTask, Selection
from trueangle.formats.formats import FORMATS, find_format, known_format
from trueangle.formats.textfile import create_text

from .test_wpilog import record, started
from .workbook import needs_library

SEED = 31_400
#: Rows, and rows in hand at once: one, less than a block, whole blocks, and a rest.
COUNTS, BLOCK = (1, 7, 900, 1013), 300


def table(count):
    """Times that are not evenly spaced, two angles, a gap in one of them, small whole numbers."""
    rng = np.random.default_rng([SEED, count])
    columns = {
        "time_s": np.round(np.cumsum(rng.uniform(0.01, 0.02, count)), 6),
        "ref": np.round(rng.uniform(-400.0, 400.0, count), 6),
        "enc": np.round(rng.uniform(-400.0, 400.0, count), 6),
        "count": rng.integers(0, 30_000, count).astype(float),
    }
    columns["enc"][count // 2 :: 97] = np.nan if count > 1 else 0.5
    return columns


def rows_of(columns, between="", names=False):
    for row in zip(*columns.values(), strict=True):
        cells = ["" if np.isnan(x) and not names else f"{x:.6f}" for x in row]
        pairs = zip(columns, cells, strict=True)
        yield between.join(f"{n}:{x}" for n, x in pairs) if names else between.join(cells)


def write_text(between):
    def write(path, columns):
        path.write_text("\n".join([between.join(columns), *rows_of(columns, between)]) + "\n")

    return write


def write_packed(write):
    """As ``write`` does, packed as the ending says."""

    def packed(path, columns):
        needs_library(path.suffix)
        plain = path.with_suffix("")
        write(plain, columns)
        with create_text(path) as file:
            file.write(plain.read_bytes())
        plain.unlink()

    return packed


def write_serial(path, columns):
    path.write_text("\r\n".join(rows_of(columns, ",", names=True)) + "\r\n")


def write_arrow(path, columns):
    pa = pytest.importorskip("pyarrow")
    kinds = {"count": pa.uint16()}
    made = pa.table({n: pa.array(v, kinds.get(n), from_pandas=True) for n, v in columns.items()})
    if path.suffix == ".parquet":
        pytest.importorskip("pyarrow.parquet").write_table(made, path, row_group_size=BLOCK)
        return
    new = pa.ipc.new_stream if path.suffix == ".arrows" else pa.ipc.new_file
    with pa.OSFile(str(path), "wb") as file, new(file, made.schema) as writer:
        writer.write_table(made, max_chunksize=BLOCK)


def write_hdf5(path, columns):
    with pytest.importorskip("h5py").File(path, "w") as file:
        for name, values in columns.items():
            kind = {"ref": ">f8", "count": "<u2"}.get(name, "<f8")
            file[name] = values.astype(kind)
            file[name].attrs["units"] = {"ref": "deg", "enc": "deg"}.get(name, "s")


def write_matlab(form):
    def write(path, columns):
        vectors = {n: v.astype(np.uint16) if n == "count" else v for n, v in columns.items()}
        pytest.importorskip("scipy.io").savemat(path, vectors, format=form, oned_as="column")

    return write


def write_npz(path, columns):
    kinds = {"ref": ">f8", "count": "u2"}
    np.savez(path, **{n: v.astype(kinds.get(n, "f8")) for n, v in columns.items()})


def write_npy(path, columns):
    kinds = {"ref": ">f8", "count": "u2"}
    made = np.empty(columns["ref"].size, [(name, kinds.get(name, "f8")) for name in columns])
    for name, values in columns.items():
        made[name] = values
    np.save(path, made)


def write_wpilog(path, columns):
    parts = [b"WPILOG\x00\x01\x00\x00\x00\x00"]
    kinds = {"ref": ("double", "<f8"), "enc": ("double", "<f8"), "count": ("int64", "<i8")}
    for number, (name, (kind, _)) in enumerate(kinds.items(), 1):
        parts.append(record(0, 0, started(number, name, kind)))
    for i, time in enumerate(np.rint(1e6 * columns["time_s"]).astype(int).tolist()):
        for number, (name, (_, code)) in enumerate(kinds.items(), 1):
            parts.append(record(number, time, columns[name][i].astype(code).tobytes()))
    path.write_bytes(b"".join(parts))


def write_mdf(path, columns):
    asammdf = pytest.importorskip("asammdf")
    kinds = {"ref": "<f8", "enc": "<f8", "count": "<u2"}
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(
            [
                asammdf.Signal(columns[n].astype(k), columns["time_s"], name=n, unit="deg")
                for n, k in kinds.items()
            ]
        )
        mdf.save(path, overwrite=True)


#: Format, how its file is written, and what its copies do not hold a note in.
FILES = {
    "a.parquet": ("parquet", write_arrow, True), "a.arrow": ("arrow", write_arrow, True),
    "a.arrows": ("arrow", write_arrow, True), "a.h5": ("hdf5", write_hdf5, True),
    "five.mat": ("matlab", write_matlab("5"), True),
    "four.mat": ("matlab", write_matlab("4"), True),
    "a.npz": ("npz", write_npz, True), "a.npy": ("npy", write_npy, False),
    "a.wpilog": ("wpilog", write_wpilog, True), "a.mf4": ("mdf", write_mdf, True),
    "a.csv": ("csvfile", write_text(","), False), "a.tsv": ("csvfile", write_text("\t"), False),
    "a.txt": ("seriallog", write_serial, False),
    "a.csv.gz": ("csvfile", write_packed(write_text(",")), False),
    "a.tsv.zst": ("csvfile", write_packed(write_text("\t")), False),
    "a.txt.gz": ("seriallog", write_packed(write_serial), False),
}  # fmt: skip

#: Formats that hold the time apart from the columns that are listed.
TIME_APART = {"mdf"}
#: A variable of one number is none of MATLAB's vectors, and one line no serial log.
VECTORS = {"matlab", "seriallog"}
#: Names of one letter less, in the order of names.
SORTED = {"hdf5"}


MADE = [(n, c) for n in FILES for c in COUNTS if c > 1 or FILES[n][0] not in VECTORS]


@pytest.fixture(params=MADE, ids=lambda p: f"{p[0]}-{p[1]}")
def made(request, tmp_path, monkeypatch):
    """A file, its format and what it holds."""
    name, count = request.param
    kind, write, has_note = FILES[name]
    columns = table(count)
    write(tmp_path / name, columns)
    found = find_format(tmp_path / name)
    assert found.module_name == kind
    for size in ("_BLOCK", "_BATCH", "BLOCK", "_ROWS"):
        monkeypatch.setattr(found.module, size, BLOCK, raising=False)
    monkeypatch.setattr("trueangle.formats.csvfile.SMALL", 0)
    if kind in TIME_APART:
        del columns["time_s"]
    return SimpleNamespace(
        path=tmp_path / name, format=found, module=found.module, columns=columns, note=has_note
    )


def whole(parts, names):
    parts = list(parts)
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def test_it_holds_the_columns_and_no_other(made):
    names = made.module.columns(made.path, None)
    wanted = sorted(made.columns) if made.format.module_name in SORTED else list(made.columns)
    assert names == wanted
    some = ["enc", "ref"]  # in any order
    found = whole(made.module.read(made.path, Selection(some)), some)
    for name in some:
        assert found[name].dtype.isnative
        np.testing.assert_allclose(found[name], made.columns[name], rtol=1e-15, err_msg=name)
    every = whole(made.module.read(made.path, Selection(names)), names)
    for name, values in made.columns.items():
        np.testing.assert_allclose(every[name], values, rtol=1e-12, err_msg=name)
    for part in made.module.read(made.path, Selection(some)):
        assert len({values.size for values in part.values()}) == 1


def test_its_extent_is_told_before_it_is_read(made):
    rows = made.columns["ref"].size
    extent = made.format.extent(made.path, ["ref", "enc"], None)
    if made.format.module_name in ("csvfile", "seriallog"):
        # By the lengths of the first lines, of all lines here.
        assert extent.rows == pytest.approx(rows, abs=2)
        assert extent.size == 0
    else:
        told = 2 * rows if made.format.module_name == "wpilog" else rows
        assert (extent.rows, extent.size) == (told, 16 * told)
        assert made.format.extent(made.path, [], None).size == 0


def test_its_stretches_are_the_whole(made):
    names = ["ref", "enc"]
    parts = [
        part
        for stretch in made.format.stretches(made.path)
        for part in made.module.read(made.path, Selection(names, None, stretch))
    ]
    for name in names:
        found = np.concatenate([part[name] for part in parts])
        np.testing.assert_allclose(found, made.columns[name], rtol=1e-15)


def test_all_columns_are_together_and_a_row_has_its_line(made):
    together = getattr(made.module, "together", None)
    if together is not None:
        assert together(made.path, ["enc"], ["ref", "count"]) == ["ref", "count"]
    first = 1 if made.format.module_name == "seriallog" else 2
    for row in {0, made.columns["ref"].size // 2, made.columns["ref"].size - 1}:
        assert made.format.line_of(made.path, row) == row + first


ADDED = "corrected_x"
ENTRY = {"column": ADDED, "from": "enc", "model": 'm "1" <é>.json', "unit": "deg"}


def twice(indicated, signals=None):
    return np.asarray(2.0 * indicated + signals["place"], dtype=np.float64)


def test_a_copy_has_one_column_more_and_says_how_it_was_made(made):
    addition = SimpleNamespace(
        column="enc", added=ADDED, signals={"place": "ref"}, entry=ENTRY, correct=twice
    )
    asked, watched = [], []

    def choose(names):
        asked.append(list(names))
        return [addition]

    target = made.path.with_name(f"out_{made.path.name}")
    before = made.path.read_bytes()
    kept = made.module.copy(
        CopyTask(made.path, target, choose, lambda rows, part: watched.append((rows, part)))
    )
    assert made.path.read_bytes() == before
    assert asked == [made.module.columns(made.path, None)]
    assert kept == made.module.contents(target, None)
    rows = made.columns["ref"].size
    # Records of all entries in a data log.
    assert kept.rows == (4 * rows if made.format.module_name == "wpilog" else rows)
    assert sum(count for count, _ in watched) == rows
    parts = [part for _, part in watched]
    assert parts == sorted(parts)
    assert 0.0 < parts[-1] <= 1.0
    names = made.module.columns(target, None)
    added = set(names) - set(asked[0])
    assert added == {ADDED}
    after = {**made.columns, ADDED: 2.0 * made.columns["enc"] + made.columns["ref"]}
    for name, values in after.items():
        found = whole(made.module.read(target, Selection([name])), [name])[name]
        np.testing.assert_allclose(found, values, rtol=1e-12, err_msg=name)
    text = target.read_bytes().decode("utf-8", "replace")
    if made.note and made.format.module_name not in ("arrow", "parquet", "hdf5", "mdf"):
        start = text.index('{"package": "trueangle')
        told, _ = json.JSONDecoder().raw_decode(text[start:])
        assert told == {"package": f"trueangle {ta.__version__}", "corrected": [ENTRY]}
    assert note_of(made.format.module_name, target) in (None, ENTRY)


def test_a_copy_is_known_by_all_that_it_added(made):
    """Two columns, and a third by a copy of that copy: read back they are what was written."""

    def added(column, name):
        other = {"enc": "ref", "ref": "enc"}[column]
        return SimpleNamespace(
            column=column, added=name, signals={"place": other},
            entry={**ENTRY, "column": name, "from": column},
            correct=lambda values, signals: twice(values, signals) + len(name),
        )  # fmt: skip

    source = made.path
    for parts in (
        [("enc", "corrected_x"), ("ref", "x_corrected_y")],
        [("ref", "corrected_abc")],
    ):
        target = source.with_name(f"out_{source.name}")
        task = CopyTask(source, target, lambda _, p=parts: [added(*k) for k in p], lambda *_: None)
        kept = made.module.copy(task)
        assert kept == made.module.contents(target, None), parts
        both = made.columns["enc"] + made.columns["ref"]
        for column, name in parts:
            found = whole(made.module.read(target, Selection([name])), [name])[name]
            wanted = both + made.columns[column] + len(name)
            np.testing.assert_allclose(found, wanted, rtol=1e-12, err_msg=name)
        source = target


def note_of(kind, target):
    """The entry where a library reads it."""
    if kind == "hdf5":
        with pytest.importorskip("h5py").File(target) as file:
            assert file[ADDED].attrs["units"] == "deg"
            return json.loads(file[ADDED].attrs["trueangle"])["corrected"][0]
    if kind in ("parquet", "arrow"):
        pa = pytest.importorskip("pyarrow")
        if kind == "parquet":
            schema = pytest.importorskip("pyarrow.parquet").read_schema(target)
        else:
            opened = pa.ipc.open_stream if target.suffix == ".arrows" else pa.ipc.open_file
            schema = opened(pa.OSFile(str(target))).schema
        assert schema.field(ADDED).type == pa.float64()
        return json.loads(schema.metadata[b"trueangle"])["corrected"][0]
    if kind == "mdf":
        with pytest.importorskip("asammdf").MDF(target) as mdf:
            told = mdf.file_history[-1].comment
            assert mdf.get(ADDED).unit == "deg"
            group = mdf.groups[mdf.channels_db[ADDED][0][0]].channel_group
            assert group.acq_name == "trueangle"
            assert json.loads(group.comment)["corrected"] == [ENTRY]
        assert "<tool_id>trueangle</tool_id>" in told
        return json.loads(ElementTree.fromstring(told).findtext("TX"))["corrected"][0]
    return None


def test_every_ending_is_that_of_one_format_and_said():
    """By the ending alone, as an output has it; MATLAB's stands for the newest first."""
    wanted = {
        "parquet": ".parquet .pq", "arrow": ".arrow .feather .ipc .arrows",
        "hdf5": ".h5 .hdf5 .hdf .he5 .mat .nc", "rosbag": ".bag .db3 .mcap", "mdf": ".mf4 .mdf",
        "wpilog": ".wpilog", "npy": ".npy", "npz": ".npz", "camonitor": ".camonitor",
        "csvfile": ".csv .tsv .tab .txt .csv.gz .tsv.gz .tab.gz .txt.zst .xlsx .xlsm",
    }  # fmt: skip
    for name, endings in wanted.items():
        for ending in endings.split():
            known = known_format(Path(f"none{ending}"))
            assert known.module_name == name, ending
    extras = {"parquet": "arrow", "arrow": "arrow", "hdf5": "hdf5", "matlab": "matlab",
              "rosbag": "ros", "mdf": "mdf"}  # fmt: skip
    assert {f.module_name: f.extra for f in FORMATS if f.extra} == extras
    assert {f.module_name: f.unit for f in FORMATS if f.unit} == {"rosbag": "rad"}


@pytest.mark.parametrize("name", [n for n, (k, *_) in FILES.items() if k not in VECTORS])
def test_a_file_of_one_reading_is_one_run(name, tmp_path):
    FILES[name][1](tmp_path / name, table(1))
    signals = {"reference": ("ref", "deg"), "indicated": ("enc", "deg")}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (run,) = ta.read_runs(tmp_path / name, signals=signals)
    assert len(run) == 1
    assert run.reference[0] == pytest.approx(table(1)["ref"][0])
