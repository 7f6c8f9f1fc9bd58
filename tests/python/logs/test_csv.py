"""CSV logs: every line keeps its text; with pyarrow and without the numbers are the same."""

import csv
import io
import sys

import numpy as np
import pytest

import trueangle as ta
from trueangle.formats import csvfile as csvlog

from .conftest import made_angles

WAYS = ["standard library"] + (["pyarrow"] if csvlog._plain_block() else [])


@pytest.fixture(params=WAYS)
def way(request, monkeypatch):
    if request.param == "standard library":
        monkeypatch.setattr(csvlog, "_plain_block", lambda: None)
    # Small blocks put borders everywhere, also inside lines.
    monkeypatch.setattr(csvlog, "BLOCK", 701)
    monkeypatch.setattr(csvlog, "SMALL", 0)
    monkeypatch.setattr("trueangle.formats.csvrows.BLOCK", 701)
    return request.param


def corrected_text(text, model, tmp_path, name="a.csv", **options):
    source = tmp_path / name
    source.write_bytes(text.encode() if isinstance(text, str) else text)
    report = ta.correct_logs(source, model, tmp_path / f"out_{name}", **options)
    if report.logs[0].error is not None:
        assert not (tmp_path / f"out_{name}").exists()
        raise report.logs[0].error
    assert report.logs[0].result["rows"] == rows_of(text)
    return (tmp_path / f"out_{name}").read_bytes().decode()


def rows_of(text):
    text = text.decode() if isinstance(text, bytes) else text
    return sum(1 for row in csv.reader(io.StringIO(text, newline="")) if row) - 1


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_lines_keep_their_text(way, delimiter, ending, model, tmp_path):
    angles = made_angles(400)
    rows = [["t", "indicated_deg", "räd"]]
    rows += [[f"{i:04d}", f"{x:.6f}", "007 "] for i, x in enumerate(angles)]
    text = "".join(delimiter.join(row) + ending for row in rows)
    out = corrected_text(text, model, tmp_path)
    lines, before = out.split(ending), text.split(ending)
    assert lines[0] == delimiter.join(["t", "indicated_deg", "räd", "corrected_deg"])
    assert [line.rpartition(delimiter)[0] for line in lines[1:-1]] == before[1:-1]
    assert lines[-1] == ""
    found = np.array([line.rpartition(delimiter)[2] for line in lines[1:-1]], float)
    np.testing.assert_array_equal(found, model.correct(np.round(angles, 6)))


def test_quoted_cells_may_hold_delimiters_quotes_and_line_breaks(way, model, tmp_path):
    plain = [f"{x:.3f},plain" for x in made_angles(100)]
    quoted = ['10,"a, b"', '20,"two\nlines\n"', '"30","she said ""no"""', "40,after"]
    text = "\n".join(["indicated_deg,note", *plain, *quoted, *plain]) + "\n"
    out = corrected_text(text, model, tmp_path)
    before = list(csv.reader(io.StringIO(text, newline="")))
    after = list(csv.reader(io.StringIO(out, newline="")))
    assert [row[:2] for row in after] == before
    expected = model.correct(np.array([float(row[0]) for row in before[1:]]))
    np.testing.assert_array_equal(np.array([row[2] for row in after[1:]], float), expected)
    assert 'she said ""no"""' in out


def test_odd_files(way, model, tmp_path):
    value = model.correct(5.0)
    cases = {
        "blank lines": ("indicated_deg,t\n5,1\n\n5,2\n\n", [value, value]),
        "no last line end": ("indicated_deg,t\n5,1\n5,2", [value, value]),
        "spaces and a plus": ("indicated_deg,t\n 5 ,1\n+5,2\n5e0,3\n", [value] * 3),
        "byte order mark": (b"\xef\xbb\xbfindicated_deg,t\n5,1\n", [value]),
        "header only": ("indicated_deg,t\n", []),
        "not UTF-8 elsewhere": (b"indicated_deg,t\n5,\xe9\n", None),
    }
    for i, (name, (text, expected)) in enumerate(cases.items()):
        if expected is None:
            source = tmp_path / "latin.csv"
            source.write_bytes(text)
            assert ta.correct_logs(source, model, tmp_path / "latin_out.csv").is_done, name
            assert b"5,\xe9," in (tmp_path / "latin_out.csv").read_bytes()
            continue
        out = corrected_text(text, model, tmp_path, f"{i}.csv")
        found = [row[-1] for row in csv.reader(io.StringIO(out, newline="")) if row][1:]
        np.testing.assert_array_equal(np.array(found, float), expected, err_msg=name)


def test_missing_readings_stay_as_they_are(way, model, tmp_path):
    out = corrected_text("indicated_deg,t\n,1\nnan,2\n5,3\nNaN,\n", model, tmp_path)
    cells = [line.split(",") for line in out.split()[1:]]
    assert [row[:2] for row in cells] == [["", "1"], ["nan", "2"], ["5", "3"], ["NaN", ""]]
    assert [cells[0][2], cells[1][2], cells[3][2]] == ["", "nan", "nan"]


BAD = {
    "text": (["1", "2", "x7"], "line 4, column 'indicated_deg': a number is needed, got 'x7'"),
    "too many cells": (["1", "2,9"], "line 3: 2 values where the header has 1"),
    "an open quote": (["1", '"2'], "not readable as CSV"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_lines_are_named(way, case, model, tmp_path):
    lines, message = BAD[case]
    with pytest.raises(ta.errors.FileError, match=message):
        corrected_text("\n".join(["indicated_deg", *lines]) + "\n", model, tmp_path)


def test_bad_lines_far_down_are_named(way, model, tmp_path):
    lines = [f"{x:.3f},1" for x in made_angles(3000)]
    lines[2500] = "oops,1"
    with pytest.raises(ta.errors.FileError, match=r"line 2502.*oops"):
        corrected_text("\n".join(["indicated_deg,t", *lines]) + "\n", model, tmp_path)


def test_threads_of_arrow_keep_no_text_of_pythons(tmp_path):
    """One that lets go of it while Python ends would abort the process."""
    csvblocks = pytest.importorskip("trueangle.formats.csvblocks")
    path = tmp_path / "a.csv"
    path.write_text("time_s,indicated_deg\n" + "0.25,12.5\n" * 100_000)
    with path.open("rb") as file:
        header = csvblocks.Header(path, file)
        data = file.read()
    for _ in range(100):
        block = csvblocks.plain_block(data, header, 2)
        before = sys.getrefcount(data)
        block.numbers(["indicated_deg"])
        assert sys.getrefcount(data) == before
