"""``--signal [JOINT.]ROLE=NAME[:UNIT]`` in the commands."""

import json

import numpy as np
import pytest
from scipy import constants

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.support.roles import ANGLE_UNITS, PLAIN_UNITS, TIME_UNITS

THETA = np.linspace(0.0, 700.0, 400)
SAID = THETA + 0.3 * np.sin(np.radians(THETA))
NAMED = ["--signal", "reference=IOC:m1.RBV:deg", "--signal", "indicated=motor pos:rad"]


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "rig.csv"
    columns = np.column_stack([THETA, np.radians(SAID), np.arange(THETA.size)])
    np.savetxt(path, columns, "%.12g", ",", header="IOC:m1.RBV,Motor  Pos,t [ms]", comments="")
    return path


@pytest.fixture
def model(tmp_path):
    found = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.3])], 0.0, 360.0)
    found.save(tmp_path / "joint.json")
    return found


def test_the_same_words_in_every_command(table, tmp_path, capsys):
    output = str(tmp_path / "made.json")
    assert main(["fit", str(table), "-o", output, "--orders", "1,2", "--json", *NAMED]) == 0
    order = json.loads(capsys.readouterr().out)["orders"][0]
    assert order["amplitude_arcsec"] == pytest.approx(1080.0, rel=1e-4)
    one_pass = ["--one-pass", "--orders", "1,2", "--json", *NAMED]
    assert main(["fit", str(table), "-o", output, *one_pass]) == 0
    order = json.loads(capsys.readouterr().out)["orders"][0]
    assert order["amplitude_arcsec"] == pytest.approx(1080.0, rel=1e-4)
    assert main(["orders", str(table), "--json", *NAMED]) == 0
    found = json.loads(capsys.readouterr().out)["orders"]
    assert next(row for row in found if row["order"] == 1)["retained"]
    assert main(["check", str(table), "--json", *NAMED]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ratio"] == pytest.approx(1.0, abs=0.01)
    assert {"role": "time", "name": "t [ms]", "unit": "ms"} not in found["columns"]
    assert {"role": "indicated", "name": "Motor  Pos", "unit": "rad"} in found["columns"]


def test_several_joints_have_columns_of_their_own(table, model, tmp_path):
    file = tmp_path / "joint.json"
    models = [*("-m", f"elbow={file}"), *("-m", f"wrist={file}")]
    columns = [
        "--signal",
        "elbow.indicated=IOC:m1.RBV:deg",
        "--signal",
        "wrist.indicated=motorpos:rad",
    ]
    output = tmp_path / "out.csv"
    assert main(["correct", str(table), "-o", str(output), *models, *columns]) == 0
    made = np.genfromtxt(output, delimiter=",", skip_header=1)
    np.testing.assert_allclose(made[:, 3], model.correct(THETA), atol=1e-9)
    np.testing.assert_allclose(np.degrees(made[:, 4]), THETA, atol=1e-8)


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (["--signal", "indicated=motor pos:rad", "--column", "x"], 2, "name the same"),
        (["--signal", "indicated=motor pos", "--unit", "rad"], 2, "name the same"),
        (["--signal", "indicated"], 2, r"[JOINT.]ROLE=NAME[:UNIT] is needed"),
        (["--signal", "angel=x"], 2, "no column has the role 'angel'"),
        (["--signal", "indicated=motor"], 1, "no such column"),
        (["--signal", "a.indicated=x"], 1, "ROLE=NAME is needed"),
    ],
)
def test_mistakes_of_usage_end_with_2_others_with_1(
    options, status, message, table, model, tmp_path, capsys
):
    command = ["correct", str(table), "-m", str(tmp_path / "joint.json")]
    try:
        ended = main([*command, "-o", str(tmp_path / "out.csv"), *options])
    except SystemExit as end:
        ended = end.code
    assert ended == status
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out.csv").exists()


def test_python_takes_the_same(table, model, tmp_path):
    signals = {"indicated": ("motor pos", "rad")}
    report = ta.correct_logs(table, model, tmp_path / "out.csv", signals=signals)
    assert report.is_done
    with pytest.raises(ArgumentError, match="give one"):
        ta.correct_logs(table, model, tmp_path / "out.csv", signals=signals, column="x")
    fitted = ta.fit_logs(table, [1], signals={**signals, "reference": ("ioc:m1.rbv", "deg")})
    assert fitted.model.amplitudes[0] == pytest.approx(0.3, rel=1e-4)


PLACES = np.arange(12) * 30.0
RAW = np.linspace(-40.0, 90.0, 12)


def celsius(unit):
    return constants.convert_temperature(RAW, {"C": "Celsius", "K": "Kelvin", "F": "F"}[unit], "C")


#: One of each unit in that of the signal: Nm, A.
ONE = {
    "torque": {"Nm": 1.0, "mNm": constants.milli, "Ncm": constants.centi, "kNm": constants.kilo},
    "current": {"A": 1.0, "mA": constants.milli},
}


def read(role, unit, column, sign=""):
    table = {"reference_deg": PLACES, "indicated_deg": PLACES, "x": column}
    (run,) = ta.read_runs(table, signals={role: (f"{sign}x", unit)})
    return run.signal(role)


@pytest.mark.parametrize(("sign", "times"), [("", 1.0), ("-", -1.0)])
@pytest.mark.parametrize(
    ("role", "unit"), [(r, u) for r, units in PLAIN_UNITS.items() for u in units]
)
def test_of_what_is_no_angle(role, unit, sign, times):
    wanted = celsius(unit) if role == "temperature" else RAW * ONE[role][unit]
    np.testing.assert_allclose(read(role, unit, RAW, sign), times * wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("unit", TIME_UNITS)
def test_of_time(unit):
    seconds = np.arange(12) * 0.25
    one = {"s": 1.0, "ms": constants.milli, "us": constants.micro, "ns": constants.nano}[unit]
    np.testing.assert_allclose(read("time", unit, seconds / one), seconds, rtol=1e-12)


@pytest.mark.parametrize("unit", ANGLE_UNITS)
def test_of_angles(unit):
    """The mount, and an error that stands for the indicated angle."""
    one = {
        "deg": constants.degree, "rad": 1.0, "turn": 2.0 * constants.pi,
        "arcsec": constants.arcsec, "arcmin": constants.arcmin,
    }[unit] / constants.degree  # fmt: skip
    np.testing.assert_allclose(read("mount", unit, RAW / one), RAW, rtol=1e-12)
    table = {"reference_deg": PLACES, "x": 0.01 * RAW / one}
    (run,) = ta.read_runs(table, signals={"error": ("x", unit)})
    np.testing.assert_allclose(run.indicated - run.reference, 0.01 * RAW, atol=1e-12)


@pytest.mark.parametrize("unit", ["deg", "rad", "turn"])
def test_of_velocity(unit):
    one = {"deg": 1.0, "rad": 1.0 / constants.degree, "turn": 360.0}[unit]
    np.testing.assert_allclose(read("velocity", f"{unit}/s", RAW / one), RAW, rtol=1e-12)


@pytest.mark.parametrize("kind", ["stamps", "durations"])
@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize("unit", ["ms", "ns"])
def test_times_of_a_table_in_memory_are_seconds(kind, first, unit):
    """From the first that is known; a reading without one is left out."""
    since = (250 * np.arange(12)).astype("timedelta64[ms]").astype(f"timedelta64[{unit}]")
    clock = since if kind == "durations" else np.datetime64("2026-12-31T23:59:59", unit) + since
    clock[:first] = "NaT"
    table = {"reference_deg": PLACES, "indicated_deg": PLACES, "clock": clock}
    if first:
        with pytest.warns(ta.errors.EmptyCellsWarning, match=f"{first} of 12 rows"):
            (run,) = ta.read_runs(table, signals={"time": "clock"})
    else:
        (run,) = ta.read_runs(table, signals={"time": "clock"})
    seconds = 0.25 * np.arange(first, 12)
    wanted = seconds if kind == "durations" else seconds - seconds[0]
    np.testing.assert_allclose(run.time, wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("written", "turn"),
    [('["]', 1_296_000.0), ("[\u2033]", 1_296_000.0), ("[arcseconds]", 1_296_000.0),
     ("[']", 21_600.0), ("[\u2032]", 21_600.0)],
)  # fmt: skip
@pytest.mark.parametrize("apart", [False, True])
def test_signs_of_seconds_and_minutes_of_arc(written, turn, apart, tmp_path):
    """In the name of a column, and in a line of units."""
    between = "\n[deg]," if apart else " "
    head = f"reference,error{between}{written}" if apart else f"reference_deg,error {written}"
    rows = [f"{x},{12.5 + x}" for x in PLACES]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    (run,) = ta.read_runs(tmp_path / "a.csv")
    np.testing.assert_allclose(run.indicated - PLACES, (12.5 + PLACES) * 360.0 / turn, rtol=1e-9)
