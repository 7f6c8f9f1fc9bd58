"""The command line: fit and correct end to end, exit statuses, one-line errors."""

import argparse
import json
import os
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import COMMANDS, fit, main, plan
from trueangle.cli.options import refuse_given
from trueangle.cli.signal_options import add_signals
from trueangle.cli.values import seconds, turns
from trueangle.logs.keeping import KEPT, SAMPLE
from trueangle.rehearsal import after
from trueangle.simulation import RunDesign, Simulation, simulate


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
    for chosen in (["r0", "r2"], ["!r1"], ["r*", "!r0"]):
        assert main([*arguments, *(f"--run={label}" for label in chosen)]) == 0
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


SECONDS = {
    "10": 10.0, "10s": 10.0, "0.5 s": 0.5, "500ms": 0.5, "2min": 120.0, "1h": 3600.0, "1H": 3600.0,
}  # fmt: skip


@pytest.mark.parametrize("text", SECONDS)
def test_a_time_is_in_seconds(text):
    assert seconds(text) == pytest.approx(SECONDS[text])


@pytest.mark.parametrize(
    "text", ["10x", "s", "-1s", "0", "nan", "inf", "1e999h", "1 2s", "10us", ""]
)
def test_what_is_no_time_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="a time above zero"):
        seconds(text)


@pytest.mark.parametrize(
    ("text", "wanted"), [("1turn", 1.0), ("5turns", 5.0), ("0.5", 0.5), (" 2 turns ", 2.0)]
)
def test_travel_is_in_turns(text, wanted):
    assert turns(text) == wanted


def after_options():
    parser = argparse.ArgumentParser(add_help=False)
    plan.add_arguments(parser)
    (group,) = [g for g in parser._action_groups if "after" in str(g.title)]
    signals = argparse.ArgumentParser(add_help=False)
    add_signals(signals)
    output = [action for action in parser._actions if action.dest == "output"]
    found = [*group._group_actions, *signals._actions, *output]
    return [action for action in found if action.dest != "after"]


@pytest.mark.parametrize("given", after_options(), ids=lambda action: action.dest)
def test_an_option_of_a_plan_after_a_diagnosis_is_refused_without_one(given):
    """Whichever it is, and by its long name, also where what is given counts as nothing."""
    args = argparse.Namespace(**{action.dest: None for action in after_options()})
    refuse_given(args, plan.OF_AFTER, "is of")
    for value in ("x", 0):
        setattr(args, given.dest, value)
        with pytest.raises(ta.errors.ArgumentError, match=rf"^{given.option_strings[-1]} is of"):
            refuse_given(args, plan.OF_AFTER, "is of")


def test_a_command_refuses_it(capsys):
    for words in (["--seeds", "0"], ["--counts-per-turn", "4096"], ["--topic", "/joints"]):
        assert main(["plan", "--gear-ratio", "100", *words]) == 1
        assert f"{words[0]} is of plans after a diagnosis" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fit", "orders"])
def test_readings_from_which_on_one_pass_is_made_are_those_that_the_help_tells(
    command, monkeypatch, capsys
):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    asked, by_itself = (int(n) for n in re.findall(r"more than 2\^(\d+)", text))
    kept = int(re.search(r"some (\d+) 000 of them", text)[1])
    assert asked == KEPT.bit_length() - 1
    assert kept * 1000 == pytest.approx(SAMPLE, rel=0.01)
    limits = []

    def hold_at_most(paths, most, topic):
        limits.append(most)
        return True

    monkeypatch.setattr("trueangle.logs.sources.logs_hold_at_most", hold_at_most)
    args = SimpleNamespace(
        one_pass=False, scheduler=None, runs=["."], topic=None, nuisance="none",
        reference_orders=None, run=None,
    )  # fmt: skip
    assert not fit.wants_one_pass(args)
    assert limits == [1 << by_itself]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have no names here")
def test_a_pipe_is_read_once_and_into_memory(tmp_path):
    """It is not opened to see how much it holds, which would take from it."""
    os.mkfifo(tmp_path / "pipe")
    args = SimpleNamespace(
        one_pass=False, scheduler=None, runs=[str(tmp_path / "pipe")], topic=None, nuisance="none",
        reference_orders=None, run=None,
    )  # fmt: skip
    assert not fit.wants_one_pass(args)


def test_values_that_a_command_cannot_take(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["record", "log.txt", "-o", "c.csv", "--rate", "0"]) == 1
    assert "--rate must be positive, got 0.0" in capsys.readouterr().err
    (tmp_path / "a.csv").write_text("reference_deg,indicated_deg\n0,0.1\n90,90.2\n180,180\n")
    words = ["fit", "a.csv", "-o", "m.json", "--one-pass", "--periods-per-turn", "1"]
    assert main(words) == 1
    message = (
        "--periods-per-turn is for sine and cosine channels, which need all readings: leave "
        "--one-pass out"
    )
    assert message in capsys.readouterr().err


SIM = Simulation(sigma_arcsec=2.0, runs=(RunDesign(samples=40),))


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """What `plan_after` is given for some options."""
    SIM.save(tmp_path / "belief.toml")
    ta.write_runs(simulate(SIM), tmp_path / "runs.csv")
    (tmp_path / "limits.toml").write_text("[limits]\nruns = 3\n")

    found = []

    def plan_after(runs, sim, **given):
        found.append((len(runs), sim.sigma_arcsec, given))
        raise ta.errors.ArgumentError("a plan is not needed here")

    monkeypatch.setattr(after, "plan_after", plan_after)
    monkeypatch.chdir(tmp_path)

    def ask(*words):
        assert main(["plan", "--after", "runs.csv", "--simulation", "belief.toml", *words]) == 1
        runs, sigma, given = found.pop()
        assert (runs, sigma) == (1, 2.0)
        return given

    return ask


def test_without_options_it_is_the_plan_of_the_api_and_limits_are_those_of_the_file(asked):
    assert asked() == {"between": None, "limits": None, "progress": "auto"}
    assert asked("--limits", "limits.toml")["limits"].runs == 3


@pytest.mark.parametrize(
    ("words", "name", "value"),
    [
        (("--seeds", "0"), "seeds", 0),
        (("--seeds", "25"), "seeds", 25),
        (("--within", "1min"), "within", 60.0),
        (("--between", "backlash,latency"), "between", ["backlash", "latency"]),
    ],
)
def test_an_option_is_what_it_is_made_by(words, name, value, asked):
    """Nought, too: no simulated diagnoses."""
    given = asked(*words)
    assert given.pop(name) == value
    others = asked()
    others.pop(name, None)
    assert given == others
