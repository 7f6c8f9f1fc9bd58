"""The line that an error or a warning names is the line of the file, wherever it is cut."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import EmptyCellsWarning, FileError, UnreadColumnWarning
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


h5py = pytest.importorskip("h5py")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

NAMES = ["cold", "warm", "hot Ä"]
ZEROS = np.array([0.0, 7.0, -4.0])


def readings():
    rng = np.random.default_rng(17)
    x = np.sort(rng.uniform(0.0, 360.0, 150))
    run = rng.integers(0, 3, x.size)
    return x, x + ZEROS[run] + 0.08 * np.cos(np.radians(2.0 * x)), [NAMES[k] for k in run]


def hdf5(path, kind, chunked):
    x, y, run = readings()
    more = {"chunks": (32,), "compression": "gzip"} if chunked else {}
    with h5py.File(path, "w") as file:
        file.create_dataset("reference_deg", data=x, **more)
        file.create_dataset("indicated_deg", data=y, **more)
        texts = [name.encode() for name in run] if kind == "S9" else run
        file.create_dataset("run", data=np.array(texts, dtype=kind), **more)


def parquet(path, kind):
    x, y, run = readings()
    if kind == "fixed":
        column = pa.array([name.encode().ljust(9, b"\0") for name in run], pa.binary(9))
    elif kind == "dictionary":
        column = pa.array([name.encode() for name in run]).dictionary_encode()
    else:
        column = pa.array([name.encode() for name in run]).cast(kind)
    pq.write_table(pa.table({"reference_deg": x, "indicated_deg": y, "run": column}), path)


CASES = [
    *(("h5", kind, chunked) for kind in ("S9", "vlen") for chunked in (False, True)),
    *(("parquet", k, None) for k in (pa.string(), pa.binary(), pa.large_binary(), "fixed")),
    ("parquet", "dictionary", None),
]


@pytest.mark.parametrize(("ending", "kind", "chunked"), CASES, ids=str)
def test_texts_are_labels(ending, kind, chunked, tmp_path):
    path = tmp_path / f"runs.{ending}"
    if ending == "h5":
        hdf5(path, h5py.string_dtype() if kind == "vlen" else kind, chunked)
    else:
        parquet(path, kind)
    runs = ta.read_runs(path)
    assert sorted(run.label for run in runs) == sorted(NAMES)
    _, y, run = readings()
    first = next(r for r in runs if r.label == NAMES[2])
    np.testing.assert_array_equal(first.indicated, y[np.array(run) == NAMES[2]])
    fit = ta.fit(path, orders=[1, 2])
    np.testing.assert_allclose(fit.amplitudes, [0.0, 0.08], atol=1e-12)


def test_a_text_is_no_angle_to_correct(tmp_path):
    path = tmp_path / "log.h5"
    hdf5(path, "S9", False)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.1])], 0.0, 360.0)
    report = ta.correct_logs(path, model, tmp_path / "out.h5", column="run", unit="deg")
    assert "no such column; its columns are" in str(report.logs[0].error)
    assert not (tmp_path / "out.h5").exists()


def lists(path, name):
    """A column of this name of a type that is neither number nor text, in every format with one."""
    x, y, run = readings()
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["reference_deg"], file["indicated_deg"] = x, y
            file[name] = np.zeros(x.size, [("a", "f4"), ("b", "i2")])
    elif path.suffix == ".npz":
        more = {name: np.full(x.size, "2026-11-28", "M8[D]")}
        np.savez(path, reference_deg=x, indicated_deg=y, **more)
    else:
        kept = pa.array([[name] for name in run])
        table = pa.table({"reference_deg": x, "indicated_deg": y, name: kept})
        if path.suffix == ".parquet":
            pq.write_table(table, path)
            return
        with pa.ipc.new_file(path, table.schema) as writer:
            writer.write_table(table)


@pytest.mark.parametrize("ending", ["h5", "npz", "parquet", "arrow"])
@pytest.mark.parametrize(
    ("name", "role"), [("run", "run"), ("direction", "direction"), ("torque_Nm", "torque")]
)
def test_a_column_with_the_name_of_a_role_that_is_left_aside_is_reported(
    ending, name, role, tmp_path
):
    path = tmp_path / f"runs.{ending}"
    lists(path, name)
    told = (
        rf"runs\.{ending}: column '{name}' is ignored: it holds neither numbers nor text; write "
        f"it as one of them to use it as the role {role}, or rename it"
    )
    with pytest.warns(UnreadColumnWarning, match=told):
        (run,) = ta.read_runs(path)
    assert run.label is None
    with pytest.warns(UnreadColumnWarning, match=told):
        ta.fit_logs(path, orders=[1, 2])
    lists(path, f"my_{name}")
    ta.read_runs(path)  # of no role: nothing is said


@pytest.mark.parametrize("ending", ["csv", "h5"])
def test_a_text_that_is_no_date_is_left_aside_and_reported(ending, tmp_path):
    path = tmp_path / f"runs.{ending}"
    x, y, _ = readings()
    if ending == "h5":
        with h5py.File(path, "w") as file:
            file["reference_deg"], file["indicated_deg"] = x, y
            file["when"] = [b"spring"] * x.size
    else:
        rows = "".join(f"{a},{b},spring\n" for a, b in zip(x, y, strict=True))
        path.write_text(f"reference_deg,indicated_deg,when\n{rows}")
    told = r"line 2, column 'when': a date and time .* got 'spring'; the column is ignored"
    with pytest.warns(UnreadColumnWarning, match=told):
        (run,) = ta.read_runs(path)
    assert run.when is None
