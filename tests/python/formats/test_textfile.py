"""Text that gzip or zstd packed, and sheets of Excel: read, corrected and refused as text is."""

import gzip
import re
import shutil
import subprocess
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import EmptyCellsWarning, FileError, MissingExtraError, OtherSheetsWarning
from trueangle.formats.budget import DecodedSizeError
from trueangle.formats.format import CopyTask, Selection
from trueangle.formats.formats import find_format
from trueangle.formats.textfile import create_text, open_text, text_extent

from .workbook import CLOCK, DATE, ELAPSED, needs_library, write_workbook

NAMES = ["run", "reference_deg", "indicated_deg"]


def rows(count=240, seed=31_500):
    """Three runs of one turn with orders 1 and 2, as cells."""
    rng = np.random.default_rng(seed)
    angle = np.arange(count) * 1080.0 / count
    error = 0.4 * np.cos(np.radians(angle) + 0.3) + 0.1 * np.sin(np.radians(2.0 * angle))
    read = np.round(angle + error + rng.normal(0.0, 1e-3, count), 6)
    return [[int(x // 360.0) + 1, round(x, 6), y] for x, y in zip(angle, read, strict=True)]


def text_of(cells):
    return "".join(",".join(map(str, row)) + "\n" for row in [NAMES, *cells])


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """One table in every way it may be stored, and a model of it."""
    needs_library(".xlsx")
    needs_library(".zst")
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "a.csv.gz", "a.csv.zst"):
        with create_text(tmp_path / name) as file:
            file.write(text_of(rows()).encode())
    write_workbook("a.xlsx", {"Readings": [NAMES, *rows()], "Empty": []})
    assert main(["fit", "a.csv", "-o", "m.json", "--orders", "1-2"]) == 0
    return tmp_path


STORED = ["a.csv.gz", "a.csv.zst", "a.xlsx"]


@pytest.mark.parametrize("name", STORED)
def test_every_command_reads_what_it_holds(name, desk, capsys):
    commands = (
        ["fit", "-o", "n.json"], ["orders"], ["check"], ["diagnose"], ["plot", "-o", "p.svg"],
        ["compare", "m.json"], ["watch", "-m", "m.json"],
    )  # fmt: skip
    for command, *more in commands:
        told = []
        for file in ("a.csv", name):
            capsys.readouterr()
            status = main([command, file, *more])
            told.append((status, capsys.readouterr().out.replace(file, "FILE")))
        assert told[0] == told[1], command
    (run, *_), (other, *_) = ta.read_runs("a.csv"), ta.read_runs(name)
    assert run.label == other.label == "1"
    np.testing.assert_array_equal(run.indicated, other.indicated)


@pytest.mark.parametrize("name", STORED)
@pytest.mark.parametrize("ending", ["csv", "csv.gz", "csv.zst"])
def test_a_corrected_copy_is_packed_as_its_ending_says(name, ending, desk, capsys):
    assert main(["correct", "a.csv", "-m", "m.json", "-o", "plain.csv"]) == 0
    assert main(["correct", name, "-m", "m.json", "-o", f"o.{ending}"]) == 0
    first = (desk / f"o.{ending}").read_bytes()[:2]
    assert first == {"csv": b"ru", "csv.gz": b"\x1f\x8b", "csv.zst": b"\x28\xb5"}[ending]
    with open_text(desk / f"o.{ending}") as file:
        found = np.loadtxt(file, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(found, np.loadtxt("plain.csv", delimiter=",", skiprows=1))
    assert found.shape == (240, 4)


def test_a_folder_of_logs_is_corrected_each_as_it_is_stored(desk, capsys):
    (desk / "logs").mkdir()
    for name in STORED:
        (desk / name).rename(desk / "logs" / name.replace("a.", f"{name[-1]}."))
    assert main(["correct", "logs", "-m", "m.json", "-o", "out"]) == 0
    made = sorted(path.name for path in (desk / "out").iterdir())
    assert made == ["t.csv.zst", "trueangle-manifest.jsonl", "x.csv", "z.csv.gz"]
    assert main(["correct", "logs/z.csv.gz", "-m", "m.json", "--in-place"]) == 0
    assert (desk / "logs" / "z.csv.gz").read_bytes() == (desk / "out" / "z.csv.gz").read_bytes()
    capsys.readouterr()
    for more in (["--in-place"], ["-o", "b.xlsx"]):
        assert main(["correct", "logs/x.xlsx", "-m", "m.json", *more]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first == "trueangle: error: x.xlsx: no Excel file is written; name a CSV file with -o"
    assert second.endswith(
        "b.xlsx: the ending .xlsx means a spreadsheet, but what is written is text, as the log is; "
        "name it b.csv"
    )


@pytest.mark.parametrize("name", ["a.csv.gz", "a.csv.zst"])
def test_a_damaged_file_is_named(name, desk):
    whole = (desk / name).read_bytes()
    damaged = whole[:200] + bytes(64) + whole[264:]
    for data in (whole[:-20], whole[:300], *([damaged] if name.endswith("gz") else [])):
        (desk / name).write_bytes(data)
        kind = "gzip" if name.endswith("gz") else "zstd"
        with pytest.raises(FileError, match=rf"{name}.*is damaged or not a {kind} file: .*; copy"):
            ta.read_runs(name)


@pytest.mark.parametrize("unpack", ["gunzip b.npy.gz", "unzstd b.npy.zst"])
def test_a_packed_file_that_is_no_text_is_refused(unpack, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = unpack.split()[1]
    needs_library(name)
    with create_text(tmp_path / name) as file:
        np.save(file, np.arange(40_000.0))
    told = f"{name}: only text is read packed; unpack it: {unpack}"
    with pytest.raises(FileError, match=re.escape(told)):
        ta.read_runs(name)
    if shutil.which(unpack.split()[0]):
        subprocess.run(unpack.split(), check=True)
        assert ta.read_runs("b.npy", signals={"indicated": ("column1", "deg")})[0].left_out == 0


@pytest.mark.parametrize("line", [b"1.25,2.5\n", b"7"])
def test_what_unpacks_to_more_than_memory_takes_is_not_held(line, tmp_path, monkeypatch):
    monkeypatch.setattr("trueangle.formats.budget.DECODED_BYTES", 1 << 20)
    for module in ("csvfile", "csvrows"):
        monkeypatch.setattr(f"trueangle.formats.{module}.BLOCK", 1 << 16)
    bomb = tmp_path / "b.csv.gz"
    with gzip.open(bomb, "wb") as file:
        file.write(b"reference_deg,indicated_deg\n")
        for _ in range(24):
            file.write((1 << 20) // len(line) * line)
    assert bomb.stat().st_size < 1 << 18
    tracemalloc.start()
    with pytest.raises(FileError):
        ta.read_runs(bomb)
    assert tracemalloc.get_traced_memory()[1] < 40 << 20
    tracemalloc.stop()


def test_rows_of_a_packed_log_are_known_before_it_is_read(desk):
    """By all of a small one, and by the part of a large one that was unpacked for it."""
    assert text_extent(desk / "a.csv.gz").rows == pytest.approx(240, abs=2)
    line = text_of(rows())
    with create_text(desk / "b.csv.gz") as file:
        for _ in range(3000):
            file.write(line.encode())
    assert text_extent(desk / "b.csv.gz").rows == pytest.approx(241 * 3000, rel=0.5)


def test_cells_of_a_sheet_are_those_of_a_csv_file(tmp_path):
    """A preamble, units, dates, gaps, and numbers to their last digit; other sheets are named."""
    needs_library(".xlsx")
    table = [
        [None, "Rig 7"],
        [],
        [None, "time", "when", "reference", "indicated", "note"],
        [None, "s", None, "deg", "rad", None],
        [None, (ELAPSED, 0.25), (DATE, 46000.5), 0, 0.1, "two\nlines"],
        [None, (ELAPSED, 1.25), (DATE, 46000.75), 1e-300, None, "a, b"],
        [None, None, None, None, None, None],
        [
            None,
            (ELAPSED, 2.25),
            (DATE, 46000.75),
            -0.30000000000000004,
            123456.78901234567,
            (CLOCK, 0.25),
        ],
    ]
    write_workbook(tmp_path / "a.xlsx", {"Chart": [], "Table": table, "B": [["x"]], "C": [[1]]})
    left_out = r"a\.xlsx: only the first sheet that holds cells is read, not 'B', 'C'; save another"
    with (
        pytest.warns(OtherSheetsWarning, match=left_out),
        pytest.warns(EmptyCellsWarning, match=r"1 of 3 rows.*line 6, column 'indicated \[rad\]'"),
    ):
        (run,) = ta.read_runs(tmp_path / "a.xlsx")
    assert run.time.tolist() == [21600.0, 194400.0]
    assert run.when == "2025-12-09T12:00:00"
    assert run.reference.tolist() == [0.0, -0.30000000000000004]
    np.testing.assert_allclose(run.indicated, np.degrees([0.1, 123456.78901234567]), rtol=1e-15)
    assert run.columns["note"].tolist() == ["two lines", "06:00:00"]


def test_a_workbook_that_cannot_be_read_is_refused(tmp_path, monkeypatch):
    needs_library(".xlsx")
    book = tmp_path / "a.xlsx"
    write_workbook(book, {"A": [NAMES, *rows()]})
    whole = book.read_bytes()
    for data in (whole[:-100], whole[:400] + bytes(40) + whole[440:]):
        book.write_bytes(data)
        with pytest.raises(
            FileError, match=r"is damaged or not an Excel file: .*; save it again, o"
        ):
            ta.read_runs(book)
    write_workbook(book, {"A": [], "B": []})
    with pytest.raises(FileError, match="no sheet holds a cell; a header line and readings are"):
        ta.read_runs(book)
    write_workbook(book, {"A": [NAMES, *rows()]})
    with zipfile.ZipFile(book) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    far = parts["xl/worksheets/sheet0.xml"].replace(b'r="C241"', b'r="XFD1048576"')
    with zipfile.ZipFile(book, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {**parts, "xl/worksheets/sheet0.xml": far}.items():
            archive.writestr(name, data)
    reaches = "reaches from its first cell to row 1048576, column 16384: more than is held in"
    with pytest.raises(DecodedSizeError, match=reaches):
        ta.read_runs(book)
    with zipfile.ZipFile(book, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {**parts, "xl/media/a.png": bytes(3 << 20)}.items():
            archive.writestr(name, data)
    monkeypatch.setattr("trueangle.formats.budget.DECODED_BYTES", 1 << 21)
    with pytest.raises(DecodedSizeError, match=r"one workbook unpacks to 3\.\d+ MiB"):
        ta.read_runs(book)


@pytest.mark.parametrize(
    ("library", "name", "extra"),
    [("python_calamine", "a.xlsx", "excel"), ("backports", "a.csv.zst", "zstd")],
)
def test_an_extra_that_is_not_installed_is_named(library, name, extra, tmp_path, monkeypatch):
    if extra == "zstd" and sys.version_info >= (3, 14):
        return  # Python has it
    write_workbook(tmp_path / "a.xlsx", {"A": [NAMES, [1, 2.0, 3.0]]})
    (tmp_path / "a.csv.zst").write_bytes(b"\x28\xb5\x2f\xfd")
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'trueangle\[{extra}\]'"):
        ta.read_runs(tmp_path / name)


@pytest.mark.parametrize("packed", [".gz", ".zst"])
def test_serial_logs_are_packed_as_well(packed, tmp_path):
    needs_library(packed)
    lines = [f"ref:{x},enc:{x + 0.25}\n" for x in range(700)]
    source, target = tmp_path / f"robot.log{packed}", tmp_path / f"out.txt{packed}"
    with create_text(source) as file:
        file.write("".join(lines).encode())
    kind = find_format(source)
    assert kind.module_name == "seriallog"
    (batch,) = kind.module.read(source, Selection(["enc"]))
    assert batch["enc"].tolist() == [x + 0.25 for x in range(700)]
    written = kind.module.copy(CopyTask(source, target, lambda _names: [], lambda *_: None))
    assert written == kind.module.contents(target, None)
    with open_text(target) as file:
        assert file.read() == "".join(lines).encode()
