"""Serial logs of named values, as sketches for the serial plotter print them."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError, MessageLinesWarning
from trueangle.formats import seriallog
from trueangle.formats.formats import find_format

ROWS = 40
TRUE = np.linspace(0.0, 2.0 * np.pi, ROWS)
READ = TRUE + 0.01 * np.sin(TRUE)
SIGNALS = {"reference": ("ref", "rad"), "indicated": ("enc", "rad")}
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])


def rows(form):
    return [form.format(a, b) for a, b in zip(TRUE.tolist(), READ.tolist(), strict=True)]


STYLES = {
    "plotter": "ref:{:.9f},enc:{:.9f}",
    "blanks": "ref: {:.9f} enc: {:.9f} ",
    "tabs": "ref:{:.9f}\tenc:{:.9f}",
    "signs": "ref = {:.9f}; enc = {:.9f};",
}


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("style", STYLES)
def test_rows_are_read_and_corrected_with_words_among_them(style, ending, tmp_path):
    lines = ["MOT: Ready.", *rows(STYLES[style])]
    lines.insert(9, "voltage low (11.8 V)")
    path = tmp_path / "serial.log"
    path.write_bytes(ending.join(lines).encode())
    with pytest.warns(MessageLinesWarning, match=r"2 lines of words.*line 1: 'MOT: Ready.'"):
        (run,) = ta.read_runs(path, signals=SIGNALS)
    np.testing.assert_allclose(run.reference, TRUE, atol=1e-9)
    np.testing.assert_allclose(run.indicated, READ, atol=1e-9)
    wanted = {"indicated": ("enc", "rad")}
    report = ta.correct_logs(path, MODEL, tmp_path / "out.log", signals=wanted)
    assert report.is_done, report.logs[0].error
    after = (tmp_path / "out.log").read_bytes().decode().split(ending)
    for one, other in zip(lines, after, strict=True):
        assert other.startswith(one.rstrip(" ;"))
        assert other.endswith(one[len(one.rstrip(" ;")) :])
    assert (after[0], after[9]) == (lines[0], lines[9])
    wanted = {**SIGNALS, "indicated": "corrected_rad"}
    with pytest.warns(MessageLinesWarning):
        found = ta.read_runs(tmp_path / "out.log", signals=wanted)
    np.testing.assert_array_equal(found[0].indicated, MODEL.correct(run.indicated))


@pytest.mark.parametrize("step", [1.0, 10_000.0])
@pytest.mark.parametrize("block", [7, 1 << 14])
def test_the_clock_of_a_terminal_is_the_time(block, step, monkeypatch, tmp_path):
    """Over one midnight, or over five."""
    monkeypatch.setattr(seriallog, "_BLOCK", block)
    seconds = 86390.0 + step * np.arange(ROWS)
    clocks = [f"{t // 3600 % 24:02.0f}:{t // 60 % 60:02.0f}:{t % 60:06.3f} -> " for t in seconds]
    lines = [a + b for a, b in zip(clocks, rows(STYLES["plotter"]), strict=True)]
    path = tmp_path / "serial.txt"
    path.write_text("\n".join(lines) + "\n")
    (run,) = ta.read_runs(path, signals=SIGNALS)
    np.testing.assert_allclose(run.time - run.time[0], step * np.arange(ROWS))


def test_damage_is_told_by_line_and_an_end_within_a_row_is_not(tmp_path):
    path = tmp_path / "serial.txt"
    lines = rows(STYLES["plotter"])
    path.write_text("\n".join([*lines, "ref:1.2,en"]))
    with pytest.warns(MessageLinesWarning, match="1 line of words without readings is omitted"):
        (run,) = ta.read_runs(path, signals=SIGNALS)
    assert len(run) == ROWS
    for bad in ("ref:1.2,enc:1.2.5", "ref:1.2,enc:", "ref:x,enc:1"):
        path.write_text("\n".join([*lines[:6], bad, *lines[6:]]))
        with pytest.raises(FileError, match=r"line 7: names and numbers are needed, got 'ref:"):
            ta.read_runs(path, signals=SIGNALS)
    path.write_text("\n".join([*lines[:6], "ref:1.5", *lines[6:]]))
    with pytest.warns(ta.errors.EmptyCellsWarning, match="line 7, column 'enc'"):
        ta.read_runs(path, signals=SIGNALS)


@pytest.mark.parametrize("text", ["Gain: 3\nOffset: 2\na,b\n1,2\n3,4\n", "a:b,c\n1,2\n", "x: 1\n"])
def test_a_table_with_a_preamble_is_none(text, tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text(text)
    assert find_format(path).module_name == "csvfile"
