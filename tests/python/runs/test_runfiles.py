"""Reading runs: units, groups, and errors that name file, line and column."""

import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, EmptyCellsWarning, FileError
from trueangle.runs.run import as_runs

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
    "two units": ("reference_deg,reference_rad,indicated_deg\n1,1,1\n", "2 columns for"),
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


THETA = np.arange(0.0, 360.0, 10.0)


@pytest.mark.parametrize("period", [1.0, 360.0, 2.0 * math.pi])
def test_wrapped_angles_differ_by_whole_turns_and_lie_in_one(period):
    """Against exact fractions; at half a turn, which is kept, and one bit beside it."""
    half = 0.5 * period
    beside = [np.nextafter(half, 0.0), half, np.nextafter(half, period)]
    rng = np.random.default_rng(11)
    angles = np.concatenate([beside, np.negative(beside), rng.uniform(-9.0, 9.0, 500) * period])
    for angle, wrapped in zip(angles.tolist(), ta.wrap(angles, period).tolist(), strict=True):
        assert -half < wrapped <= half
        turns = (Fraction(angle) - Fraction(wrapped)) / Fraction(period)
        # One rounding of the turns taken off, one of the difference.
        assert abs(turns - round(turns)) <= 2 * abs(angle / period) * 2.0**-53 + 2.0**-53
    kept = beside[:2]
    assert ta.wrap(kept, period).tolist() == kept


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference": []}, "empty"),
        ({"reference": [[1.0]]}, "one-dimensional"),
        ({"indicated": THETA[:-1]}, "indicated has 35 readings, reference has 36"),
        ({"indicated": np.where(THETA == 50.0, np.nan, THETA)}, r"indicated\[5\] is nan"),
        ({"reference": np.where(THETA == 50.0, np.inf, THETA)}, r"reference\[5\] is inf"),
        ({"reference": ["a"] * 36}, "reference must be numbers"),
        ({"period": -360.0}, "period"),
        ({"time": -THETA}, r"time must not decrease.*time\[1\] = -10 after"),
        ({"temperature": [1.0, 2.0]}, "temperature has 2"),
        ({"weights": np.where(THETA == 50.0, -1.0, 1.0)}, r"weights\[5\]"),
        # The first of several.
        ({"weights": np.where(THETA < 50.0, 1.0, -THETA)}, r"weights\[5\] .* got -50"),
        ({"time": np.abs(THETA - 50.0)}, r"time\[1\] = 40 after 50"),
        ({"reference": np.where(THETA < 50.0, THETA, np.inf)}, r"reference\[5\] is inf"),
    ],
)
def test_bad_arguments_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        ta.CalibrationRun(**({"reference": THETA, "indicated": THETA, "period": 360.0} | change))


def test_a_scalar_stands_for_every_reading():
    run = ta.CalibrationRun(THETA, THETA, period=360.0, temperature=21.5, mount=130.0)
    assert run.temperature.shape == (36,)
    assert run.mount[7] == 130.0


def test_arrays_are_copies_that_cannot_be_written():
    theta = THETA.copy()
    run = ta.CalibrationRun(theta, theta, period=360.0)
    theta[0] = 99.0
    assert run.reference[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        run.reference[0] = 1.0


def test_pickle_keeps_everything():
    run = ta.CalibrationRun(
        THETA, THETA, 360.0, time=THETA, label="a", velocity=THETA, columns={"x": THETA}
    )
    again = pickle.loads(pickle.dumps(run))
    assert again.label == "a"
    np.testing.assert_array_equal(again.velocity, THETA)
    np.testing.assert_array_equal(again.columns["x"], THETA)


@pytest.mark.parametrize("zero", [-109.4, 0.0, 179.999, 180.0, 1234.5])
def test_centred_error_never_jumps(zero):
    error = 3.0 * np.sin(np.radians(THETA))
    run = ta.CalibrationRun(THETA, np.mod(THETA + zero + error, 360.0), period=360.0)
    centred = run.centred_error
    np.testing.assert_allclose(centred - centred.mean(), error - error.mean(), atol=1e-12)
    assert math.remainder(run.zero - zero, 360.0) == pytest.approx(0.0, abs=1e-9)


def test_direction_and_speed_follow_the_unwrapped_reference():
    time = np.arange(9) * 0.5
    reference = np.array([350, 355, 0, 5, 10, 10, 5, 0, 355.0])
    run = ta.CalibrationRun(reference, reference, 360.0, time=time)
    np.testing.assert_array_equal(run.direction, [1, 1, 1, 1, 1, 1, -1, -1, -1])
    np.testing.assert_allclose(run.speed[1:4], 10.0)
    np.testing.assert_allclose(run.speed[-1], -10.0)
    assert ta.CalibrationRun(reference, reference, 360.0).speed is None


def test_equal_time_stamps_do_not_make_infinite_speeds():
    time = np.array([0.0, 0.0, 1.0, 1.0, 2.0])
    run = ta.CalibrationRun([0, 1, 10, 11, 20.0], [0, 1, 10, 11, 20.0], 360.0, time=time)
    np.testing.assert_allclose(run.speed, [10, 10, 9.75, 9.75, 9.5])


def test_a_given_velocity_wins():
    run = ta.CalibrationRun(THETA, THETA, 360.0, velocity=np.full(36, -4.0))
    np.testing.assert_array_equal(run.direction, -1.0)


def test_runs_of_two_units_are_refused():
    one = ta.CalibrationRun(THETA, THETA, period=360.0)
    other = ta.CalibrationRun(THETA, THETA, period=1.0)
    with pytest.raises(ArgumentError, match="different units"):
        as_runs([one, other])
    with pytest.raises(ArgumentError, match="at least one"):
        as_runs([])
    with pytest.raises(ArgumentError, match=r"runs\[0\].*str"):
        as_runs("joint.csv")


def test_further_signals_are_of_one_container():
    run = ta.CalibrationRun(
        THETA,
        THETA,
        period=360.0,
        torque=1.5,
        signals={"current": -0.5, "head2": THETA + 1.0, "head1": THETA, "direction": -1.0},
        unit="arm 3",
    )
    np.testing.assert_array_equal(run.signal("current"), np.full(len(run), -0.5))
    np.testing.assert_array_equal(run.signal("torque"), run.torque)
    assert list(run.heads) == ["head1", "head2"]
    assert run.signal("shift") is None
    assert (run.direction == -1.0).all()
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.signal("head2"), THETA + 1.0)
    assert again.unit == "arm 3"


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ({"curent": 1.0}, "did you mean current"),
        ({"torque": 1.0}, "separate argument"),
        ({"head0": 1.0}, "no signal"),
        ({"current": [1.0, 2.0]}, r"signals\['current'\] has 2"),
        ({"current": np.nan}, "must be finite"),
        ([1.0], "must be a mapping"),
    ],
)
def test_signals_that_are_none(signals, message):
    with pytest.raises(ArgumentError, match=message):
        ta.CalibrationRun(THETA, THETA, period=360.0, signals=signals)


def test_readings_before_the_first_motion_belong_to_it():
    reference = [350.0, 350.0, 345.0, 345.0, 350.0]
    run = ta.CalibrationRun(reference, reference, 360.0)
    np.testing.assert_array_equal(run.direction, [-1, -1, -1, -1, 1])
    still = ta.CalibrationRun([5.0, 5.0], [5.0, 5.0], 360.0, time=[0.0, 2.0])
    np.testing.assert_array_equal(still.direction, [0, 0])
    moved = ta.CalibrationRun([5.0, 15.0], [5.0, 15.0], 360.0, time=[0.0, 2.0])
    np.testing.assert_array_equal(moved.speed, [5.0, 5.0])


@pytest.mark.parametrize("zero", [100.0, -179.9, 0.0])
def test_a_centred_error_is_the_error_but_for_whole_turns(zero):
    run = ta.CalibrationRun(THETA, np.mod(THETA + zero + np.sin(THETA), 360.0), period=360.0)
    turns = (run.centred_error - run.error) / 360.0
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert abs(run.centred_error - run.zero).max() < 2.0


def test_heads_stand_in_the_order_of_their_numbers():
    names = {f"head{k}": THETA + k for k in (10, 2, 1)}
    run = ta.CalibrationRun(THETA, THETA, period=360.0, signals=names)
    assert list(run.heads) == ["head1", "head2", "head10"]
