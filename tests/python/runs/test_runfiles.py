"""Reading runs: units, groups, and errors that name file, line and column."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import EmptyCellsWarning, FileError

GOOD = "run,reference_deg,indicated_deg,time_s,note\na,0,0.5,0,x\na,90,90.5,1,y\nb,0,0.25,0,z\n"


def written(tmp_path, text, name="runs.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_runs_by_label_in_order_with_their_columns(tmp_path):
    path = written(tmp_path, GOOD.replace("a,", "z,"))
    first, second = ta.read_runs(path)
    assert (first.label, second.label) == ("z", "b")
    assert first.period == 360.0
    np.testing.assert_array_equal(first.indicated, [0.5, 90.5])
    np.testing.assert_array_equal(first.time, [0.0, 1.0])
    assert first.columns["note"].tolist() == ["x", "y"]
    assert first.source.file == "runs.csv"
    assert len(first.source.sha256) == 64


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("bom", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_dialects_of_spreadsheets(tmp_path, delimiter, bom, newline):
    text = GOOD.replace(",", delimiter).replace("\n", newline)
    assert len(ta.read_runs(written(tmp_path, bom + text.encode()))) == 2


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("rad", 2 * math.pi), ("turn", 1.0)])
def test_the_unit_is_in_the_column_name(tmp_path, unit, turn):
    text = f"reference_{unit},indicated_{unit},mount_deg,velocity_deg_s\n0,0.1,90,180\n"
    (run,) = ta.read_runs(written(tmp_path, text))
    assert run.period == turn
    assert run.label is None
    assert run.mount[0] == pytest.approx(turn / 4)
    assert run.velocity[0] == pytest.approx(turn / 2)


def test_counts_are_reduced_to_the_unit_of_the_reference(tmp_path):
    path = written(tmp_path, "reference_deg,indicated_count\n90,1024\n")
    (run,) = ta.read_runs(path, counts_per_turn=4096)
    assert run.indicated[0] == 90.0
    with pytest.raises(FileError, match="`counts_per_turn="):
        ta.read_runs(path)


REFUSED = {
    "empty": ("", "line 1.*empty"),
    "header only": ("reference_deg,indicated_deg\n", "no readings"),
    "one column": ("reference_deg\n1\n", "no column indicated_deg"),
    "no reference": ("indicated_deg,x\n1,2\n", "no column reference_deg.*indicated_deg, x"),
    "text": (GOOD.replace("90.5", "abc"), r"line 3, column 'indicated_deg'.*'abc'"),
    "NaN": (GOOD.replace("90.5", "nan"), r"line 3, column 'indicated_deg'.*nan"),
    "lines in a cell": (GOOD.replace("90.5", '"90\n5"'), r"column 'indicated_deg'.*'90\\n5'"),
    "infinity": (GOOD.replace("90.5", "inf"), r"line 3, column 'indicated_deg'.*inf"),
    "short line": (GOOD.replace(",y", ""), "line 3: 4 values where the header has 5"),
    "time": (GOOD.replace("90.5,1", "90.5,-1"), r"line 3, column 'time_s'.*backwards"),
    "two units": ("reference_deg,reference_rad,indicated_deg\n1,1,1\n", "units are mixed"),
    "mixed units": ("reference_deg,indicated_rad\n1,1\n", "units are mixed.*deg.*rad"),
    "reference in counts": ("reference_count,indicated_deg\n1,1\n", "reference_count"),
    "doubled column": ("reference_deg,indicated_deg,indicated_deg\n1,1,1\n", "twice"),
    "not text": (b"reference_deg,indicated_deg\n1,\xff\xfe\n", "line 2.*UTF-8"),
    "a stray quote": ('reference_deg,indicated_deg\n1,"2"3\n', "line 2.*CSV"),
    "not Parquet": (b"PAR1 but no more", "Parquet"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_files_get_one_error_with_its_place(case, tmp_path):
    text, message = REFUSED[case]
    path = written(tmp_path, text)
    with pytest.raises(FileError, match=message) as caught:
        ta.read_runs(path)
    assert str(caught.value).startswith(str(path))


def test_files_of_different_units_are_refused(tmp_path):
    one = written(tmp_path, GOOD)
    other = written(tmp_path, "reference_rad,indicated_rad\n0,0\n", "other.csv")
    with pytest.raises(FileError, match=r"other\.csv.*another unit"):
        ta.read_runs([one, other])


def test_parquet_reads_like_csv(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    path = tmp_path / "runs.parquet"
    table = {"run": ["a", "a"], "reference_deg": [0.0, 90.0], "indicated_deg": [0.5, 90.5]}
    pq.write_table(pa.table(table), path)
    (run,) = ta.read_runs(path)
    np.testing.assert_array_equal(run.indicated, [0.5, 90.5])
    pq.write_table(pa.table(table | {"indicated_deg": [0.5, None]}), path)
    with pytest.warns(EmptyCellsWarning, match=r"1 of 2 rows.*line 3, column 'indicated_deg'"):
        (run,) = ta.read_runs(path)
    assert (len(run), run.left_out) == (1, 1)


def test_signals_go_there_and_back(tmp_path):
    from trueangle import write_runs

    text = (
        "unit,run,reference_turn,indicated_turn,current_A,shift_deg,motor_rad,head1_turn\n"
        "left,1,0,0,1.5,90,6.25,0.5\nright,1,0.5,0.5,2.5,180,12.5,0.25\n"
    )
    runs = ta.read_runs(written(tmp_path, text))
    assert [(run.unit, run.label) for run in runs] == [("left", "1"), ("right", "1")]
    assert runs[1].signal("current")[0] == 2.5
    assert runs[1].signal("shift")[0] == pytest.approx(0.5)
    assert runs[1].signal("motor")[0] == pytest.approx(12.5 / (2.0 * math.pi))
    assert write_runs(runs, tmp_path / "again.csv") == 2
    again = ta.read_runs(tmp_path / "again.csv")
    assert [(run.unit, run.label) for run in again] == [("left", "1"), ("right", "1")]
    for before, after in zip(runs, again, strict=True):
        for name in ("current", "shift", "motor", "head1"):
            scale = 1.0 if name == "current" else 360.0
            assert after.signal(name)[0] == pytest.approx(scale * before.signal(name)[0])


def test_rows_with_an_empty_cell_are_counted_left_out_and_said(tmp_path):
    path = written(tmp_path, GOOD.replace("90.5", "").replace("0.25", " "))
    with pytest.raises(FileError, match="every row of run b has an empty cell"):
        ta.read_runs(path)
    path = written(tmp_path, GOOD.replace("90.5", ""))
    with pytest.warns(EmptyCellsWarning, match=r"1 of 3 rows.*line 3, column 'indicated_deg'"):
        first, second = ta.read_runs(path)
    assert [first.left_out, second.left_out] == [1, 0]
    assert first.columns["note"].tolist() == ["x"]
    # Of several the first.
    path = written(tmp_path, f"{GOOD}b,,0.5,1,z\nb,20,20.5,,z\n")
    told = r"2 of 5 rows have an empty cell and are omitted, the first at line 5, .*reference_deg"
    with pytest.warns(EmptyCellsWarning, match=told):
        assert [run.left_out for run in ta.read_runs(path)] == [0, 2]


def test_entries_of_a_turn_stand_at_even_places():
    """Entry i of n at i/n of a turn, whether those before it hold a number or not."""
    table = {"entry_deg": [0.5, 90.5, None, 270.5]}
    with pytest.warns(EmptyCellsWarning, match="1 of 4 rows has an empty cell and is omitted"):
        (run,) = ta.read_runs(table)
    np.testing.assert_array_equal(run.reference, [0.0, 90.0, 270.0])
    np.testing.assert_array_equal(run.indicated, [0.5, 90.5, 270.5])
    assert (run.period, run.left_out) == (360.0, 1)


NUMBERS = ["1_0", "\u0661", "0x10", "1,5", "1e", "--1", "True", "\x00", "1\u00b2"]


@pytest.mark.parametrize("cell", NUMBERS)
@pytest.mark.parametrize("quote", ["", '"'])
def test_only_digits_of_ascii_are_numbers(cell, quote, tmp_path):
    path = written(tmp_path, f"reference_deg;indicated_deg\n0;0.5\n1;{quote}{cell}{quote}\n")
    if cell == "1,5":  # decimal commas beside semicolons
        assert ta.read_runs(path)[0].indicated[1] == 1.5
        return
    with pytest.raises(FileError, match=r"line 3, column 'indicated_deg': a number is needed"):
        ta.read_runs(path)


def test_a_long_cell_takes_its_own_room_only(tmp_path):
    rows = "".join(f"{i},{i},x\n" for i in range(20_000))
    path = written(tmp_path, "reference_deg,indicated_deg,note\n" + rows + f"1,1,{'y' * 90_000}\n")
    (run,) = ta.read_runs(path)  # as an array of texts: 7 GB
    assert len(run.columns["note"][-1]) == 90_000


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi, 1.0])
def test_runs_are_written_in_degrees_whatever_their_unit(period, tmp_path):
    """Angles and speeds; loads, temperatures and times are what they are."""
    turn = np.linspace(0.1, 0.9, 9)
    run = ta.CalibrationRun(
        turn * period, (turn + 1e-3) * period, period, time=np.arange(9.0), torque=2.0 * turn,
        temperature=20.0, mount=0.25 * period, velocity=0.1 * period, label="a",
        signals={"current": 0.5, "head1": 0.5 * period},
    )  # fmt: skip
    assert ta.write_runs([run], tmp_path / "a.csv") == 9
    (back,) = ta.read_runs(tmp_path / "a.csv")
    assert (back.period, back.label) == (360.0, "a")
    for name in ("reference", "indicated", "mount", "velocity"):
        np.testing.assert_allclose(getattr(back, name), getattr(run, name) * 360.0 / period)
    np.testing.assert_allclose(back.signal("head1"), 180.0)
    for name in ("time", "torque", "temperature", "current"):
        np.testing.assert_array_equal(back.signal(name), run.signal(name))


@pytest.mark.parametrize("doubled", ["time_s", "note"])
def test_of_columns_that_appear_twice_that_one_is_named(doubled, tmp_path):
    lines = [
        f"{line},{extra}" for line, extra in zip(GOOD.splitlines(), (doubled, 0, 1, 2), strict=True)
    ]
    path = written(tmp_path, "\n".join(lines) + "\n")
    with pytest.raises(FileError, match=rf"{doubled}.*appears twice"):
        ta.read_runs(path)


@pytest.mark.parametrize(
    ("times", "told"),
    [
        ((5, 1, 5, 1, 6, 2), None),  # stamps that repeat, and runs that overlap
        ((5, 1, 6, 2, 5.5, 1.5), r"line 6, column 'time_s': .*: 5.5 after 6;"),
        ((5, 3, 6, 2, 7, 1), r"line 5, column 'time_s': .*: 2 after 3;"),  # the first of two
    ],
)
def test_time_of_each_run_may_stand_still_but_not_run_back(tmp_path, times, told):
    rows = [f"{'ab'[i % 2]},{10 * i},{10 * i}.5,{t}" for i, t in enumerate(times)]
    path = written(tmp_path, "\n".join(["run,reference_deg,indicated_deg,time_s", *rows]))
    if told is not None:
        with pytest.raises(FileError, match=told):
            ta.read_runs(path)
        return
    for run, k in zip(ta.read_runs(path), (0, 1), strict=True):
        np.testing.assert_array_equal(run.time, times[k::2])
