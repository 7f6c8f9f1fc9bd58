"""Units of errors in what is printed, and numbers rounded to their uncertainty."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle.cli import build_parser, main
from trueangle.errors import ArgumentError
from trueangle.support.display_units import ERROR_UNITS, error_unit, significant_digits

#: Commands that print errors.
PRINTING = {
    "fit",
    "orders",
    "diagnose",
    "selfcal",
    "compare",
    "correct",
    "import",
    "export",
    "join",
}


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        ("arcsec", "7228.0 +- 3.1 arcsec"),
        ("deg", "2.00778 +- 0.00086 deg"),
        ("mrad", "35.042 +- 0.015 mrad"),
        ("auto", "2.00778 +- 0.00086 deg"),
        (65536, "365.50 +- 0.16 count"),
    ],
)
def test_one_error_in_every_unit(asked, shown):
    assert error_unit(asked, largest=7228.0).text(7228.0, 3.1) == shown


def test_small_errors_stay_in_arcsec():
    assert error_unit("auto", largest=3599.0).name == "arcsec"
    assert error_unit("auto", largest=3600.0).name == "deg"


def test_counts_are_those_of_the_readings():
    assert error_unit("count", period=4096.0).text(1_296_000.0 / 4096.0) == "1.000 count"
    with pytest.raises(ArgumentError, match="`counts_per_turn="):
        error_unit("count", period=360.0)


@pytest.mark.parametrize("asked", ["minutes", -1.0, math.nan])
def test_other_units_are_refused(asked):
    with pytest.raises(ArgumentError):
        error_unit(asked)


@given(
    st.floats(-1e6, 1e6),
    st.floats(1e-6, 1e5),
    st.sampled_from([unit for unit in ERROR_UNITS if unit != "count"]),
)
def test_rounding_loses_less_than_a_twentieth_of_the_uncertainty(value, std, asked):
    """Two digits of the uncertainty: half a unit of the second is at most 5 % of it."""
    unit = error_unit(asked, largest=abs(value))
    shown, spread = map(float, unit.pair(value, std))
    one = std * unit.per_arcsec
    # Uncertainties of ten units and more are shown whole: half a unit then is below 5 % too.
    assert abs(shown - value * unit.per_arcsec) <= 0.0501 * one
    assert abs(spread - one) <= 0.0501 * one


@given(st.floats(1e-9, 1e9))
def test_four_digits_are_kept(value):
    text = significant_digits(value)
    assert "e" not in text
    assert float(text) == pytest.approx(value, rel=5.1e-4)


@pytest.mark.parametrize("command", sorted(PRINTING))
def test_commands_that_print_errors_take_a_unit(command):
    assert "--errors-in" in build_parser().commands[command]._option_string_actions


@pytest.fixture
def runs(tmp_path):
    """Two degrees of order 1, as a table in degrees."""
    theta = np.arange(0.0, 360.0, 2.0)
    rng = np.random.default_rng(19)
    rows = ["run,reference_deg,indicated_deg"]
    for run in range(3):
        error = 2.008 * np.sin(np.radians(theta)) + rng.normal(0.0, 0.002, theta.size)
        rows += [f"{run},{a!r},{b!r}" for a, b in zip(theta.tolist(), (theta + error).tolist(),
                                                     strict=True)]  # fmt: skip
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def printed(arguments, capsys):
    assert main([str(a) for a in arguments]) == 0
    return capsys.readouterr().out


def test_large_errors_are_printed_in_degrees(runs, tmp_path, capsys):
    text = printed(["fit", runs, "-o", tmp_path / "m.json", "--orders", "1"], capsys)
    row = re.search(r"output +1 +(\S+) +(\S+)", text)
    assert float(row[1]) == pytest.approx(2.008, abs=0.001)
    assert float(row[2]) == pytest.approx(0.002 * math.sqrt(2 / 540), rel=1 / 3)  # of 3 runs
    assert " deg standard deviation" in text
    assert "arcsec" not in text


@pytest.mark.parametrize("unit", ["arcsec", "mrad"])
@pytest.mark.parametrize("command", ["fit", "orders"])
def test_a_unit_is_printed_as_asked_for(command, unit, runs, tmp_path, capsys):
    arguments = [command, runs, "--orders", "1,2", "--errors-in", unit]
    arguments += ["-o", tmp_path / "m.json"] if command == "fit" else []
    text = printed(arguments, capsys)
    wanted = {"arcsec": 7228.8, "mrad": 35.046}[unit]
    numbers = [float(word) for word in re.findall(r"\d+\.\d+", text)]
    assert min(abs(number / wanted - 1.0) for number in numbers) < 1e-3
    assert unit in text


def test_counts_are_taken_from_the_command_line(runs, tmp_path, capsys):
    model = tmp_path / "m.json"
    arguments = ["fit", runs, "-o", model, "--orders", "1", "--errors-in", "count"]
    assert main([str(a) for a in arguments]) == 1
    assert "--counts-per-turn" in capsys.readouterr().err
    text = printed([*arguments, "--counts-per-turn", "65536"], capsys)
    assert "count" in text
    assert re.search(r"output +1 +365\.\d+", text)


def test_json_stays_in_arcsec(runs, tmp_path, capsys):
    arguments = ["fit", runs, "-o", tmp_path / "m.json", "--orders", "1", "--json"]
    one = printed([*arguments, "--errors-in", "deg"], capsys)
    assert one == printed(arguments, capsys)
    assert '"amplitude_arcsec": 72' in one


def test_every_summary_takes_a_unit(runs):
    read = ta.read_runs(runs)
    fit = ta.fit(read, [1])
    assert "7228." in fit.summary(errors_in="arcsec")
    assert "7228." in ta.select_orders(read, [1, 2]).summary(errors_in="arcsec")
    assert "7228." in ta.compare(fit.model, ta.fit(read, [2]).model).summary(errors_in="arcsec")
