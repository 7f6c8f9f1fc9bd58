"""Every unit of every signal against numbers from outside, also of a sensor that is reversed."""

import numpy as np
import pytest
from scipy import constants

import trueangle as ta
from trueangle.support.roles import ANGLE_UNITS, PLAIN_UNITS, TIME_UNITS

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
