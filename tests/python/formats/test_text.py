"""Text files as loggers, scopes and spreadsheets write them."""

import contextlib
import io
import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError, MessageLinesWarning
from trueangle.formats import csvcells, seriallog
from trueangle.formats.formats import find_format

ROWS = 24
REFERENCE = np.arange(ROWS) * 15.0
INDICATED = REFERENCE + 0.5
TIMES = np.arange(ROWS) * 0.125


def table(delimiter=",", decimal=".", end="", columns=(TIMES, REFERENCE, INDICATED)):
    """Lines of readings."""
    cells = [[repr(float(x)).replace(".", decimal) for x in column] for column in columns]
    return "".join(delimiter.join(row) + end + "\n" for row in zip(*cells, strict=True))


def saved(form, comments, delimiter):
    """What numpy.savetxt writes."""
    text = io.StringIO()
    np.savetxt(text, np.c_[TIMES, REFERENCE, INDICATED], form, delimiter, comments=comments)
    return text.getvalue()


@pytest.fixture(params=["fast", "slow"])
def way(request, monkeypatch):
    """Text cut by Arrow, and by the standard library, which reads short files anyway."""
    monkeypatch.setattr("trueangle.formats.csvfile.SMALL", 0)
    if request.param == "slow":
        monkeypatch.setattr("trueangle.formats.csvfile._plain_block", lambda: None)


NAMES = {"reference": "ref", "indicated": "enc", "time": "t"}
COLUMNS = {"time": "column1", "reference": ("column2", "deg"), "indicated": "column3"}
SCOPE = "\t".join(["Name", "Axis.Ref", "Name", "Axis.Enc"])
TWINCAT = (
    "Name\trecord\nFile\tC:\\x.tcscopex\nStarttime of export\t132959733843760000\tMontag\n\n"
    f"{SCOPE}\nSymbolComment\t\tSymbolComment\t\nData-Type\tREAL64\tData-Type\tREAL64\n"
    "SampleTime[ms]\t125\tSampleTime[ms]\t125\nVariableSize\t8\tVariableSize\t8\n"
    "NetID\t1.2.3.4.1.1\tNetID\t1.2.3.4.1.1\nPort\t851\tPort\t851\nOffset\t0\tOffset\t0\n"
    "ScaleFactor\t1\tScaleFactor\t1\nUnit\tdeg (Angle)\tUnit\tdeg (Angle)\n"
    "Unit ScaleFactor\t1\tUnit ScaleFactor\t1\nUnit Offset\t0\tUnit Offset\t0\n\n"
)
FILES = {
    "plain": ("time_s,reference_deg,indicated_deg\n" + table(), {}),
    "brackets": ("time [s],Reference (deg),INDICATED [deg]\n" + table(), {}),
    "milliseconds": (
        "t [ms];ref [deg];enc [deg]\n"
        + table(";", ",", columns=(1e3 * TIMES, REFERENCE, INDICATED)),
        NAMES,
    ),
    "a preamble": (
        "Rig 7\noperator: N. N.\ndate,2026-11-21\n\nt,ref,enc\n" + table(),
        {**NAMES, "reference": ("ref", "deg")},
    ),
    "decimal commas with tabs": (
        "Rig 7\nt\tref [deg]\tenc [deg]\n" + table("\t", ","),
        NAMES,
    ),
    "decimal commas with blanks": ("Rig 7\nt ref[deg] enc[deg]\n" + table(" ", ","), NAMES),
    "decimal commas with blanks alone": (table("  ", ","), COLUMNS),
    "notes": (
        "# made by a logger; with, delimiters\nt,ref,enc\n# 24 rows\n" + table() + "# end\n",
        {**NAMES, "reference": ("ref", "deg")},
    ),
    "names in a note": ("# 2026\n# t,ref [deg],enc [deg]\n" + table(), NAMES),
    "a line of units": ("t,ref,enc\ns,deg,deg\n" + table(), NAMES),
    "units in brackets below": ("t;ref;enc\n[s];[deg];[deg]\n\n" + table(";"), NAMES),
    "ends of lines": ("t,ref [deg],enc [deg]\n" + table(end=","), NAMES),
    "ends of all lines": ("t;ref [deg];enc [deg];\n" + table(";", end=";"), NAMES),
    "an end of the names": ("t,ref [deg],enc [deg],\n" + table(), NAMES),
    "no names": (
        table(),
        {"time": "column1", "reference": ("column2", "deg"), "indicated": "column3"},
    ),
    "an oscilloscope": (
        "Model,DSO-X\nSource,CH1,CH2\nt,ref,enc\nsecond,deg,deg\n" + table(),
        NAMES,
    ),
    "TwinCAT": (
        TWINCAT
        + table("\t", ",", columns=(1e3 * TIMES, REFERENCE, 1e3 * TIMES, INDICATED))
        + "EOF\n",
        {"reference": "axis.ref", "indicated": "Axis.Enc"},
    ),
    "blanks around": (
        "time_s , reference_deg , indicated_deg\n" + table(" , "),
        {},
    ),
    "numpy.savetxt": (
        "# time_s reference_deg indicated_deg\n" + saved("%.18e", "# ", " "),
        {},
    ),
    "numpy.savetxt with tabs": (saved("%.18e", "", "\t"), COLUMNS),
    "gnuplot": (
        "# rig 7\n#t   ref   enc\n" + saved("%11.6f", "", "  ") + "\n\n",
        {**NAMES, "reference": ("ref", "deg")},
    ),
    "Fortran": (
        re.sub("(?m)^(?=.)", "  ", saved("%.16e", "", "   ").replace("e", "D")),
        COLUMNS,
    ),
    "Fortran with names": (
        "  time_s   reference_deg   indicated_deg\n" + saved("%10.5f", "", " "),
        {},
    ),
    "tabs among blanks": ("time_s reference_deg  indicated_deg \n" + saved("%.9f", "", " \t"), {}),
    "words of a firmware": (
        "MOT: Monitor enabled!\nMOT: Init\n"
        + table("\t").replace("\n", "\nMOT: PP check: OK!\n", 9).replace("OK!\n", "fail\n", 1),
        COLUMNS,
    ),
    "words beside blanks": (table(" ").replace("\n", "\nMOT: phase lost\n", 2), COLUMNS),
    "blank lines": ("time_s,reference_deg,indicated_deg\n\n" + table().replace("\n", "\n\n"), {}),
}


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("case", FILES)
def test_columns_are_found_whatever_stands_around_them(case, tmp_path):
    text, signals = FILES[case]
    path = tmp_path / "rig.csv"
    path.write_text(text)
    words = case.startswith("words")
    with pytest.warns(MessageLinesWarning, match="line") if words else contextlib.nullcontext():
        (run,) = ta.read_runs(path, signals=signals)
    assert run.period == 360.0
    np.testing.assert_allclose(run.reference, REFERENCE, rtol=1e-15)
    np.testing.assert_allclose(run.indicated, INDICATED, rtol=1e-15)
    np.testing.assert_allclose(run.time, TIMES, rtol=1e-12)


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_words_of_any_number_are_no_readings_of_a_copy_either(
    delimiter, way, tmp_path, monkeypatch
):
    """As many as the copy has columns, one more than the log: it could not be corrected."""
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
    for words in (3, 4, 5):
        said = delimiter.join(["ready"] * words)
        lines = [f"{i}{delimiter}{2.5 * i}" for i in range(12)]
        lines[5:5] = [said, said + delimiter]
        path, output = tmp_path / f"{words}.csv", tmp_path / f"{words} out.csv"
        path.write_text("\n".join([f"time_s{delimiter}indicated_deg", *lines]) + "\n")
        report = ta.correct_logs(path, model, output)
        assert report.is_done, report.logs[0].error
        assert report.logs[0].result["rows"] == 12
        after = output.read_text().split("\n")
        assert [line.rstrip(delimiter) for line in after[6:8]] == [said, said]


@pytest.mark.parametrize("case", FILES)
def test_a_correction_keeps_every_byte_that_it_does_not_change(case, tmp_path):
    text, signals = FILES[case]
    path = tmp_path / "rig.csv"
    path.write_text(text)
    name = signals.get("indicated", "INDICATED [deg]" if case == "brackets" else "indicated_deg")
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
    unit = {"indicated": (name if isinstance(name, str) else name[0], "deg")}
    report = ta.correct_logs(path, model, tmp_path / "out.csv", signals=unit)
    assert report.is_done, report.logs[0].error
    before, after = text.split("\n"), (tmp_path / "out.csv").read_text().split("\n")
    assert len(before) == len(after)
    for one, other in zip(before, after, strict=True):
        assert other.startswith((one, one[:-1]))
    names = {"reference": "corrected_deg", "indicated": "corrected_deg"}
    if signals.get("time") == "column1":
        names = dict.fromkeys(names, "column4")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MessageLinesWarning)
        found = {role: (name, "deg") for role, name in names.items()}
        (run,) = ta.read_runs(tmp_path / "out.csv", signals=found)
    np.testing.assert_allclose(run.reference, model.correct(INDICATED), rtol=1e-14)


def test_counts_on_both_sides(tmp_path):
    path = tmp_path / "counts.csv"
    path.write_text("reference_count,indicated_count\n0,0\n100,1024\n")
    with pytest.raises(FileError, match="`counts_per_turn_reference=`"):
        ta.read_runs(path, counts_per_turn=4096)
    (run,) = ta.read_runs(path, counts_per_turn=4096, counts_per_turn_reference=400)
    np.testing.assert_allclose(run.reference, [0.0, 90.0])
    np.testing.assert_allclose(run.indicated, [0.0, 90.0])


UNITS = {
    "arcsec": 1_296_000.0,
    "arcmin": 21_600.0,
    "deg": 360.0,
    "rad": 2.0 * math.pi,
    "turn": 1.0,
}


@pytest.mark.parametrize("unit", UNITS)
def test_named_units_are_converted(unit, tmp_path):
    path = tmp_path / "units.csv"
    path.write_text("a:b,enc,v,T,tau\n" + f"0,{UNITS[unit] / 8},2,300,1500\n")
    (run,) = ta.read_runs(
        path,
        signals={
            "reference": ("a:b", "deg"),
            "indicated": ("enc", unit),
            "velocity": ("v", "rad/s"),
            "temperature": ("T", "K"),
            "torque": ("tau", "mNm"),
        },
    )
    assert run.indicated[0] == pytest.approx(45.0)
    assert run.velocity[0] == pytest.approx(math.degrees(2.0))
    assert run.temperature[0] == pytest.approx(26.85)
    assert run.torque[0] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ({"reference": "posact"}, r"did you mean 'pos act \[rad\]'"),
        ({"refrence": "x"}, "did you mean reference"),
        ({"reference": ("pos act", "parsec")}, "use deg, rad, turn, count, "),
        ({"reference": "pos"}, "no such column"),
        ({"reference": 3}, "must be the name"),
    ],
)
def test_what_cannot_be_found_suggests_what_was_meant(signals, message, tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text("pos act [rad],indicated_rad\n0,0\n")
    if signals == {"reference": "posact"}:  # blanks are forgiven
        assert ta.read_runs(path, signals=signals)[0].period == 2.0 * math.pi
        signals = {"reference": "pos akt"}
    with pytest.raises(ValueError, match=message):
        ta.read_runs(path, signals=signals)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"\xff\xfer\x00e\x00f\x00", "UTF-16"),
        (b"reference_deg,indicated_deg\r1,1\r2,2\r", "line 2: a line ends with CR alone"),
        (b"reference_deg,indicated_deg\n" + b"1" * (1 << 25), "longer than 16 MiB"),
        (b"reference_deg,indicated_deg\n1,1\n1,1,1\n", "line 3: 3 values"),
        (b"# only\n# notes\n", "no column reference_deg|no readings"),
    ],
)
def test_what_is_no_table_is_told_in_one_line(text, problem, tmp_path):
    path = tmp_path / "odd.csv"
    path.write_bytes(text)
    with pytest.raises(FileError, match=problem) as caught:
        ta.read_runs(path)
    assert len(str(caught.value)) < 1000


def test_a_degree_sign_of_an_old_code_page(tmp_path):
    path = tmp_path / "old.csv"
    path.write_bytes("t,ref [°],enc [°]\n".encode("cp1252") + table().encode())
    (run,) = ta.read_runs(path, signals=NAMES)
    np.testing.assert_allclose(run.reference, REFERENCE)


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("first", [1, 2500])
def test_an_old_code_page_is_read_in_cells_as_in_headers(first, tmp_path, monkeypatch):
    """Wherever it stands, with UTF-8 in other rows; corrected copies keep the bytes."""
    monkeypatch.chdir(tmp_path)
    labels = [b"Pr\xfcfstand" if i < first else "Prüfling \u2019".encode() for i in range(2999)]
    rows = [b"%s,%d,%d" % (label, i % 360, i % 360) for i, label in enumerate(labels)]
    path = tmp_path / "old.csv"
    path.write_bytes(b"\n".join([b"run,reference_deg,indicated_deg", *rows]) + b"\n")
    runs = ta.read_runs(path)
    assert [(run.label, len(run)) for run in runs] == [
        ("Prüfstand", first), ("Prüfling \u2019", 2999 - first)
    ]  # fmt: skip
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.1])], period=360.0)
    ta.correct_logs(path, model, "o.csv")
    assert b"\nPr\xfcfstand,0,0," in Path("o.csv").read_bytes()


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("column", [0, 2])
def test_bytes_that_are_no_text_are_refused_wherever_they_stand(column, tmp_path):
    rows = [[b"a", b"%d" % (i % 360), b"x"] for i in range(3000)]
    bad = [list(row) for row in rows]
    bad[2500] = [b"a", b"1", b"x"]
    bad[2500][column] = b"\xff\xfe"
    head = b"run,reference_deg,indicated_deg,note\n"
    path = tmp_path / "late.csv"
    path.write_bytes(head + b"".join(b",".join([r[0], r[1], r[1], r[2]]) + b"\n" for r in bad))
    name = "run" if column == 0 else "note"
    with pytest.raises(FileError, match=rf"late\.csv, line 2502, column '{name}'.*UTF-8"):
        ta.read_runs(path)


@pytest.mark.parametrize(
    ("cell", "number"),
    [("1.5D+01", 15.0), ("-.5d0", -0.5), ("0.25-100", 0.25e-100), ("1.+002", 100.0), ("2E3", 2e3)],
)
def test_numbers_as_fortran_writes_them(cell, number):
    assert csvcells.cell_number(cell, ".") == number
    assert csvcells.cell_number(cell.replace(".", ","), ",") == number


@pytest.mark.parametrize("cell", ["1D", "D+01", "1-2", "1+02", "1D+", "0x1D"])
def test_what_looks_like_a_number_of_fortran(cell):
    assert csvcells.cell_number(cell, ".") is None


def test_words_among_readings_are_counted_and_said(tmp_path):
    lines = table("\t").splitlines()
    lines[5:5] = ["MOT: PP check: OK!", "MOT: Ready."]
    path = tmp_path / "serial.txt"
    path.write_text("\n".join(lines))
    with pytest.warns(MessageLinesWarning, match=r"2 lines of words.*line 6: 'MOT: PP check: OK!'"):
        (run,) = ta.read_runs(path, signals=COLUMNS)
    np.testing.assert_array_equal(run.reference, REFERENCE)
    path.write_text("\n".join([*lines, "1.5"]))
    with pytest.raises(FileError, match=r"line 27: 1 value where the header has 3 columns"):
        ta.read_runs(path, signals=COLUMNS)


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("rows", [5, 1500])
def test_files_that_were_put_together_are_not_read_in_part(rows, tmp_path):
    """All readings above the names that stand again were lost, and the output had them as notes."""
    one = "time_s,reference_deg,indicated_deg\n" + "".join(
        f"{k},{k}.0,{k}.5\n" for k in range(rows)
    )
    path = tmp_path / "both.csv"
    path.write_text(2 * one)
    again = f"both.csv, line {rows + 2}, column 'reference_deg': .* names are repeated there"
    with pytest.raises(FileError, match=again):
        ta.read_runs(path)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
    report = ta.correct_logs(path, model, tmp_path / "out.csv")
    assert "names are repeated there" in str(report.logs[0].error)
    assert not (tmp_path / "out.csv").exists()


SERIALLOG_ROWS = 40
TRUE = np.linspace(0.0, 2.0 * np.pi, SERIALLOG_ROWS)
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
    seconds = 86390.0 + step * np.arange(SERIALLOG_ROWS)
    clocks = [f"{t // 3600 % 24:02.0f}:{t // 60 % 60:02.0f}:{t % 60:06.3f} -> " for t in seconds]
    lines = [a + b for a, b in zip(clocks, rows(STYLES["plotter"]), strict=True)]
    path = tmp_path / "serial.txt"
    path.write_text("\n".join(lines) + "\n")
    (run,) = ta.read_runs(path, signals=SIGNALS)
    np.testing.assert_allclose(run.time - run.time[0], step * np.arange(SERIALLOG_ROWS))


def test_damage_is_told_by_line_and_an_end_within_a_row_is_not(tmp_path):
    path = tmp_path / "serial.txt"
    lines = rows(STYLES["plotter"])
    path.write_text("\n".join([*lines, "ref:1.2,en"]))
    with pytest.warns(MessageLinesWarning, match="1 line of words without readings is omitted"):
        (run,) = ta.read_runs(path, signals=SIGNALS)
    assert len(run) == SERIALLOG_ROWS
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
