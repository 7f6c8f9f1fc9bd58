"""The line that an error or a warning names is the line of the file, wherever it is cut."""

import re

import pytest

import trueangle as ta
from trueangle.errors import EmptyCellsWarning, FileError
from trueangle.formats import camonitor, csvcells, csvfile, csvrows, seriallog
from trueangle.formats.format import Selection

ROWS = 60
HEAD = "run,reference_deg,indicated_deg"


@pytest.fixture(params=[120, 400, 1 << 20])
def cut(request, monkeypatch):
    """Text is cut in blocks of so many bytes, as that of a file of many megabytes is."""
    for module in (csvfile, csvrows):
        monkeypatch.setattr(module, "BLOCK", request.param)
    monkeypatch.setattr(csvfile, "SMALL", 0)


def rows(quoted, talk):
    """Lines of readings; quotes in the second half, comments and blank lines among them."""
    found = [HEAD]
    for i in range(ROWS):
        name = '"a"' if quoted and i >= ROWS // 2 else "a"
        found.append(f"{name},{6.0 * i:g},{6.0 * i + 0.5:g}")
        if talk and i % 7 == 3:
            found += ["# paused", ""]
    return found


def broken(lines, which, text):
    """With another text in place of the angle in the given row, and the number of its line."""
    places = [i for i, line in enumerate(lines) if line and line[0] in '"a']
    at = places[which]
    lines[at] = re.sub(r"[\d.]+$", text, lines[at])
    return "\n".join(lines) + "\n", at + 1


@pytest.mark.parametrize("quoted", [False, True])
@pytest.mark.parametrize("talk", [False, True])
@pytest.mark.parametrize("which", [0, 17, ROWS // 2, ROWS - 1])
def test_of_a_table(which, talk, quoted, cut, tmp_path):
    path = tmp_path / "runs.csv"
    for text, error in (("", EmptyCellsWarning), ("open", FileError)):
        content, line = broken(rows(quoted, talk), which, text)
        path.write_text(content)
        raises = pytest.warns if error is EmptyCellsWarning else pytest.raises
        with raises(error, match=rf"line {line}, column 'indicated_deg'"):
            ta.read_runs(path)


@pytest.mark.parametrize(
    ("which", "column"), [(1, ""), (40, ", column 'run'"), (59, ", column 'run'")]
)
def test_of_a_name_that_is_no_text(which, column, cut, monkeypatch, tmp_path):
    """Among the lines that the header is looked for in, and behind them."""
    monkeypatch.setattr(csvcells, "_LINES", 20)
    lines = [line.encode() for line in rows(False, False)]
    lines[1 + which] = lines[1 + which].replace(b"a,", b"\xff\xfe,")
    path = tmp_path / "runs.csv"
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(FileError, match=rf"line {2 + which}{column}: is not UTF-8"):
        ta.read_runs(path)


@pytest.mark.parametrize("which", [0, 33, ROWS - 1])
def test_of_a_serial_log(which, monkeypatch, tmp_path):
    monkeypatch.setattr(seriallog, "_BLOCK", 8)
    lines = [f"ref:{6.0 * i:g},enc:{6.0 * i + 0.5:g}" for i in range(ROWS)]
    lines[which] = lines[which].partition(",")[0]
    lines[10:10] = ["Ready.", "", "voltage low"]
    path = tmp_path / "serial.log"
    path.write_text("\n".join(lines) + "\n")
    signals = {"reference": ("ref", "deg"), "indicated": ("enc", "deg")}
    line = which + 1 + 3 * (which >= 10)
    with (
        pytest.warns(ta.errors.MessageLinesWarning, match="2 lines of words.*line 11: 'Ready"),
        pytest.warns(EmptyCellsWarning, match=rf"1 of 60 rows.*line {line}, column 'enc'"),
    ):
        (run,) = ta.read_runs(path, signals=signals)
    assert (len(run), run.left_out) == (ROWS - 1, 1)


@pytest.mark.parametrize("which", [0, 7, 8, 33, ROWS - 1])
def test_of_a_monitor(which, monkeypatch, tmp_path):
    """Of blocks of eight lines; another variable, comments and lost lines stand among them."""
    monkeypatch.setattr(camonitor, "_BLOCK", 8)
    lines = []
    for i in range(ROWS):
        value = "open" if i == which else f"{6.0 * i:g}"
        if i % 5 == 2:
            lines += ["# paused", f"PV 2026-11-21 12:00:{i:02d} *** Disconnected", ""]
        lines.append(f"PV 2026-11-21 12:00:{i:02d}.5 {value} ")
        if i % 3 == 0:
            lines.append(f"STATE 2026-11-21 12:00:{i:02d}.7 {i} ")
        if i == which:
            line = next(k for k, text in enumerate(lines, 1) if " open " in text)
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match=rf"line {line}, column 'PV': a number is needed"):
        list(camonitor.read(path, Selection(["PV"])))
    assert [batch["STATE"].size for batch in camonitor.read(path, Selection(["STATE"]))] == [
        8,
        8,
        4,
    ]
