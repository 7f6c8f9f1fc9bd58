"""The command line: fit and correct end to end, exit statuses, one-line errors."""

import json
import subprocess
import sys

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import COMMANDS, main


def write_runs(path, seed=0, runs=3, zero=-109.4):
    rng = np.random.default_rng(seed)
    lines = ["run,reference_deg,indicated_deg,temperature_C"]
    for run in range(runs):
        for theta in np.sort(rng.uniform(0, 360, 200)):
            error = 0.4 * np.sin(np.radians(theta)) + 0.1 * np.cos(np.radians(3 * theta))
            indicated = (theta + error + zero + 0.005 * rng.normal()) % 360.0
            lines.append(f"r{run},{theta:.6f},{indicated:.6f},20")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def fitted(tmp_path):
    runs = write_runs(tmp_path / "runs.csv")
    model = tmp_path / "joint.json"
    assert main(["fit", str(runs), "-o", str(model), "--orders", "1-5"]) == 0
    return model


def last_column(path):
    lines = path.read_text().splitlines()
    return lines[0], [line.rsplit(",", 1)[1] for line in lines[1:]]


def test_fit_then_correct_readings_the_fit_has_not_seen(fitted, tmp_path, capsys):
    log = write_runs(tmp_path / "log.csv", seed=9, runs=1)
    assert main(["correct", str(log), "-m", str(fitted), "-o", str(tmp_path / "out.csv")]) == 0
    header, corrected = last_column(tmp_path / "out.csv")
    assert header == "run,reference_deg,indicated_deg,temperature_C,corrected_deg"
    (run,) = ta.read_runs(log)
    left = ta.wrap(np.array(corrected, dtype=float) - run.reference, 360.0)
    assert left.std() < 0.006  # the noise is 0.005
    assert "200 readings" in capsys.readouterr().out


def test_fit_prints_json(tmp_path, capsys):
    runs = write_runs(tmp_path / "runs.csv")
    status = main(["fit", str(runs), "-o", str(tmp_path / "m.json"), "--orders", "1,3", "--json"])
    assert status == 0
    result = json.loads(capsys.readouterr().out)
    assert [o["order"] for o in result["orders"]] == [1, 3]
    assert result["orders"][0]["amplitude_arcsec"] == pytest.approx(0.4 * 3600, abs=5)
    assert result["runs"] == 3


def test_a_run_may_be_left_out_of_the_fit(tmp_path, capsys):
    runs = write_runs(tmp_path / "runs.csv")
    arguments = ["fit", str(runs), "-o", str(tmp_path / "m.json"), "--orders", "1", "--json"]
    assert main([*arguments, "--run", "r0", "--run", "r2"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"] == 2
    assert main([*arguments, "--run", "r7"]) == 1
    assert "r0, r1, r2" in capsys.readouterr().err


@pytest.mark.parametrize("unit", ["rad", "turn", "count"])
def test_a_log_in_another_unit_is_corrected_in_that_unit(fitted, tmp_path, unit):
    turn = {"rad": 2 * np.pi, "turn": 1.0, "count": 65536.0}[unit]
    degrees = np.array([0.0, 100.0, 359.0, 725.0])
    log = tmp_path / "log.csv"
    rows = [f'"a, b",{float(x)!r},' for x in degrees * turn / 360]
    log.write_text("\n".join([f"note,joint_{unit},x", *rows]) + "\n")
    out = tmp_path / "out.csv"
    arguments = ["correct", str(log), "-m", str(fitted), "-o", str(out)]
    arguments += ["--column", f"joint_{unit}"]
    arguments += ["--counts-per-turn", "65536"] if unit == "count" else []
    assert main(arguments) == 0
    header, corrected = last_column(out)
    assert header.endswith(f",corrected_{unit}")
    expected = ta.load_model(fitted).correct(degrees)
    np.testing.assert_allclose(np.array(corrected, dtype=float) * 360 / turn, expected, atol=1e-9)
    assert '"a, b"' in out.read_text()  # other columns are kept


def test_empty_cells_and_nan_stay_as_they_are(fitted, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t,indicated_deg\n0,\n1,nan\n2,5\n")
    out = tmp_path / "out.csv"
    assert main(["correct", str(log), "-m", str(fitted), "-o", str(out)]) == 0
    _, corrected = last_column(out)
    assert corrected[:2] == ["", "nan"]
    assert float(corrected[2]) == ta.load_model(fitted).correct(5.0)


BAD_LOGS = {
    "text": ("indicated_deg\n1\nx\n", "line 3, column 'indicated_deg'"),
    "no angle": ("a,b\n1,2\n", "--column.*a, b"),
    "two angles": ("indicated_deg,indicated_rad\n1,2\n", "--column"),
    "corrected before": ("indicated_deg,corrected_deg\n1,1\n", "corrected_deg"),
    "short line": ("a,indicated_deg\n1,2\n3\n", "line 3"),
    "empty": ("", "line 1"),
}


@pytest.mark.parametrize("case", BAD_LOGS)
def test_bad_logs_leave_no_output(case, fitted, tmp_path, capsys):
    text, message = BAD_LOGS[case]
    log = tmp_path / "log.csv"
    log.write_text(text)
    before = sorted(p.name for p in tmp_path.iterdir())
    assert main(["correct", str(log), "-m", str(fitted), "-o", str(tmp_path / "out.csv")]) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == before
    assert_one_line(capsys, message)


def assert_one_line(capsys, message):
    import re

    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert re.search(message, captured.err), captured.err
    assert "Traceback" not in captured.err


def test_a_log_is_never_its_own_output(fitted, tmp_path, capsys):
    log = write_runs(tmp_path / "log.csv", runs=1)
    before = log.read_bytes()
    assert main(["correct", str(log), "-m", str(fitted), "-o", str(log)]) == 1
    assert log.read_bytes() == before
    assert_one_line(capsys, "overwrite")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fit", "missing.csv", "-o", "m.json", "--orders", "1"], r"missing\.csv.*No such file"),
        (["fit", "RUNS", "-o", "m.json", "--orders", "seventeen"], "orders.*seventeen"),
        (["fit", "RUNS", "-o", "m.json", "--orders", "5-1"], "orders.*5-1"),
        (["fit", "RUNS", "-o", "m.json", "--orders", "motor:1"], "--gear-ratio"),
        (["fit", "RUNS", "-o", "nowhere/m.json", "--orders", "1"], "nowhere"),
        (["correct", "RUNS", "-m", "missing.json", "-o", "x.csv"], r"missing\.json"),
        (["correct", "RUNS", "-m", "RUNS", "-o", "x.csv"], "not complete JSON|not a model file"),
    ],
)
def test_failures_are_one_line_and_status_1(arguments, message, tmp_path, capsys, monkeypatch):
    runs = write_runs(tmp_path / "runs.csv")
    monkeypatch.chdir(tmp_path)
    assert main([str(runs) if a == "RUNS" else a for a in arguments]) == 1
    assert_one_line(capsys, message)
    assert [p.name for p in tmp_path.iterdir()] == ["runs.csv"]


def test_usage_errors_are_status_2(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["fit"])
    assert caught.value.code == 2


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert f"trueangle {command}" in text.split("example:")[1]


def test_the_command_is_installed():
    done = subprocess.run(
        [sys.executable, "-m", "trueangle", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"trueangle {ta.__version__}\n"
