"""A simulator's log taken off the readings: the account is of measured minus simulated."""

import json

import numpy as np
import pytest

import trueangle as ta
from conftest import ROOT
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.runs.joining import minus_simulated
from trueangle.simulation import Backlash, Harmonic, RunDesign, Simulation

ARCSEC = 3600.0
SEED = 11
NOISE = 2.0
#: Five standard errors of a mean square over some thousand readings.
NOISE_TOLERANCE = 0.08


def believed(theta, velocity):
    """An error of another form than any effect's: lag, and a bent pattern."""
    return 0.02 * velocity + 0.3 * np.exp(np.sin(np.radians(theta)))


def motion(t, speed=30.0):
    """There and back over a turn, with soft ends."""
    half = 360.0 / speed
    return 180.0 - 180.0 * np.cos(np.pi * t / half)


def truth(theta, direction):
    return 40.0 / ARCSEC * np.sin(2.0 * np.radians(theta) + 0.5) + 6.0 / ARCSEC * direction


def measured(speed=30.0, label=None, start=0.0):
    rng = np.random.default_rng([SEED, int(speed)])
    t = np.arange(0.0, 720.0 / speed, 0.005)
    theta, velocity = motion(t, speed), np.gradient(motion(t, speed), t)
    error = believed(theta, velocity) + truth(theta, np.sign(velocity))
    error += rng.normal(0.0, NOISE / ARCSEC, t.size)
    return ta.CalibrationRun(theta, theta + error, 360.0, time=t + start, label=label)


def log(speed=30.0, step=0.004, start=0.0):
    t = np.arange(0.0, 720.0 / speed + 0.01, step)
    theta, velocity = motion(t, speed), np.gradient(motion(t, speed), t)
    return {
        "time_s": t + start,
        "reference_rad": np.radians(theta),
        "indicated_rad": np.radians(theta + believed(theta, velocity)),
    }


def left(found):
    """rms of what is left beyond what the simulator lacks, arcsec."""
    rest = [
        run.indicated - run.reference - truth(run.reference, run.direction) for run in found.runs
    ]
    rest = np.concatenate(rest)
    return ARCSEC * float(np.std(rest))


def test_in_time_nothing_but_the_noise_is_left():
    found = minus_simulated(measured(), log())
    assert found.by == ("time",)
    assert found.offsets_s == (0.0,)
    assert abs(left(found) - NOISE) < NOISE_TOLERANCE * NOISE
    assert found.std_arcsec < 0.1
    # Its opposite would leave the simulated error twice.
    turned = minus_simulated(measured(), {**log(), "indicated_rad": -log()["indicated_rad"]})
    assert left(turned) > 100.0


def test_another_clock_is_found():
    found = minus_simulated(measured(start=1000.0), log(start=-3.7))
    assert found.by == ("time",)
    assert found.offsets_s[0] == pytest.approx(-1003.7, abs=1e-4)
    assert abs(left(found) - NOISE) < NOISE_TOLERANCE * NOISE
    assert "shifted" in found.summary()


def test_by_angle_each_direction_has_its_own_error():
    theta = np.concatenate([np.arange(-5.0, 365.0, 0.5), np.arange(364.25, -5.75, -0.5)])
    direction = np.repeat([1.0, -1.0], theta.size // 2)

    def error(x, d):
        return 0.2 * np.sin(np.radians(3.0 * x)) + 0.05 * d

    simulated = {"reference_deg": theta, "indicated_deg": theta + error(theta, direction)}
    x = np.linspace(1.0, 359.0, 700)
    x = np.concatenate([x, x[::-1] - 0.01])
    d = np.repeat([1.0, -1.0], 700)
    for zero in (0.0, 720.0):  # another count of turns
        run = ta.CalibrationRun(x + zero, x + zero + error(x, d) + 0.1, 360.0)
        found = minus_simulated(run, simulated)
        assert found.by == ("angle",)
        # Lines over half a degree of order 3: h^2/8 (3 pi/180)^2 0.2 deg.
        assert float(np.abs(found.runs[0].error - 0.1).max()) < 2e-5
    # Over several turns the log's one turn repeats itself.
    far = np.arange(10.0, 1400.0, 0.7)
    found = minus_simulated(ta.CalibrationRun(far, far + error(far, 1.0), 360.0), simulated)
    assert float(np.abs(found.runs[0].error).max()) < 2e-5
    assert found.left_out == 0


def test_where_the_log_says_nothing_readings_are_left_out_and_counted():
    part = np.arange(0.0, 180.0)
    simulated = {"reference_deg": part, "indicated_deg": part}
    theta = np.arange(0.5, 360.0)
    found = minus_simulated(ta.CalibrationRun(theta, theta, 360.0), simulated)
    assert found.left_out == 180
    assert float(found.runs[0].reference.max()) < 180.0
    with pytest.raises(ArgumentError, match="has no value for"):
        minus_simulated(ta.CalibrationRun(theta[200:], theta[200:], 360.0), simulated)


def test_other_motions_are_joined_by_angle_and_that_is_said():
    run = measured(30.0)
    found = minus_simulated(run, log(20.0))
    assert found.by == ("angle",)
    assert "another than that of the readings" in found.summary()
    assert minus_simulated(run, log(), by="angle").by == ("angle",)
    with pytest.raises(ArgumentError, match="has no time"):
        minus_simulated(run, {k: v for k, v in log().items() if k != "time_s"}, by="time")


def test_runs_are_matched_by_their_labels():
    runs = [measured(30.0, "slow"), measured(90.0, "fast")]
    table = {name: np.concatenate([log(90.0)[name], log(30.0)[name]]) for name in log()}
    table["run"] = ["fast"] * len(log(90.0)["time_s"]) + ["slow"] * len(log(30.0)["time_s"])
    found = minus_simulated(runs, table)
    assert abs(left(found) - NOISE) < NOISE_TOLERANCE * NOISE
    table["run"] = ["other" if label == "slow" else label for label in table["run"]]
    with pytest.raises(ArgumentError, match="none of them for run slow"):
        minus_simulated(runs, table)


@pytest.mark.parametrize("library", ["pandas", "polars", "pyarrow", "xarray"])
def test_tables_of_every_library_are_runs(library):
    module = pytest.importorskip(library)
    columns = {**log(), "run": np.array(["a"] * len(log()["time_s"]))}
    make = {
        "pandas": lambda: module.DataFrame(columns),
        "polars": lambda: module.DataFrame(columns),
        "pyarrow": lambda: module.table(columns),
        "xarray": lambda: module.Dataset(
            {k: ("time_s", v) for k, v in columns.items() if k != "time_s"},
            {"time_s": columns["time_s"]},
        ),
    }[library]
    (run,) = ta.read_runs(make())
    assert run.label == "a"
    np.testing.assert_array_equal(run.time, columns["time_s"])
    np.testing.assert_array_equal(run.indicated, columns["indicated_rad"])


def test_what_is_no_table_is_refused():
    for data in (3.0, [], [3.0]):
        with pytest.raises(ArgumentError, match="table"):
            ta.read_runs(data)
    with pytest.raises(ArgumentError, match="equally long"):
        ta.read_runs({"reference_deg": [1.0, 2.0], "indicated_deg": [1.0]})
    with pytest.raises(ArgumentError, match="no simulation"):
        ta.diagnose(measured())


def test_the_extension_stands_on_top_of_the_log():
    design = tuple(RunDesign(speed_deg_s=v, reversals=(0.5,), label=str(v)) for v in (5, 20, 40))
    gear = Simulation(harmonics=(Harmonic("output", 3, 90.0, 20.0),), sigma_arcsec=NOISE)
    real = gear.with_effects([Backlash(8.0)])
    runs = ta.simulate(real, seed=SEED, runs=design)
    clean = ta.simulate(Simulation(harmonics=gear.harmonics), seed=SEED, runs=design)
    result = ta.diagnose(runs, simulated=clean, gain=False)
    assert [finding.cause for finding in result.findings] == ["backlash"]
    assert result.to_dict()["simulated"]["joined_by"] == ["time"] * 3
    again = ta.diagnose(runs, result.extended, simulated=clean, gain=False)
    assert not again.findings
    assert again.discrepancy.rms < 1.1 * NOISE


def test_command(tmp_path, capsys):
    np.savetxt(
        tmp_path / "log.csv",
        np.column_stack(list(log().values())),
        delimiter=",",
        header="t,joint,command",
        comments="",
    )
    run = measured()
    np.savetxt(
        tmp_path / "runs.csv",
        np.column_stack([run.time, run.reference, run.indicated]),
        delimiter=",",
        header="time_s,reference_deg,indicated_deg",
        comments="",
    )
    arguments = ["diagnose", str(tmp_path / "runs.csv"), "--simulated", str(tmp_path / "log.csv")]
    names = ["time=t:s", "reference=joint:rad", "indicated=command:rad"]
    arguments += [part for name in names for part in ("--signal", f"simulated.{name}")]
    assert main([*arguments, "--extend", str(tmp_path / "top.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["simulated"]["joined_by"] == ["time"]
    assert {f["cause"] for f in found["findings"]} >= {"missing_order", "backlash"}
    kinds = {effect.kind for effect in ta.load_simulation(tmp_path / "top.toml").effects}
    assert kinds == {f["cause"] for f in found["findings"] if f["status"] == "confirmed"}
    assert main(["diagnose", str(tmp_path / "runs.csv")]) == 1
    assert "--simulated LOG" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["diagnose", str(tmp_path / "runs.csv"), "--simulated-by", "place"])


def test_a_servo_against_its_own_log(data_dir, tmp_path):
    """Its lag of more than a degree is the simulator's; the sensor's errors are not."""
    (run,) = ta.read_runs(data_dir / "servo_loop_simulated.csv")
    command = np.radians(45.0) * np.minimum(run.time, 16.0 - run.time)
    simulated = ta.CalibrationRun(run.reference, command, run.period, time=run.time)
    result = ta.diagnose(run, simulated=simulated)
    (line,) = [finding for finding in result.findings if finding.confirmed]
    assert line.cause == "missing_order"
    assert line.parameters["order"].value == 2
    assert line.parameters["amplitude_arcsec"].value == pytest.approx(40.0, abs=1.0)
    # One speed: play and delay are one regressor, but the size of the reversal error is known.
    seen = {c: p for spot in result.not_identifiable for c, p in spot.estimates.items()}
    sizes = [f.parameters for f in result.findings if f.cause == "backlash"] or [seen["backlash"]]
    assert sizes[0]["half_width_arcsec"].value == pytest.approx(6.0, abs=0.3)


def test_a_servo_without_its_log_lags_by_its_velocity_gain(data_dir):
    """kv / kp = 30 ms, found to the end: what a delay leaves by its form needs no further cause."""
    result = ta.diagnose(data_dir / "servo_loop_simulated.csv", ta.Simulation())
    assert result.complete
    (late,) = [finding for finding in result.findings if finding.confirmed]
    assert late.cause == "latency"
    assert late.parameters["delay_s"].value == pytest.approx(-0.030, abs=1e-4)


def test_mujoco_servo_lacks_play_and_an_order(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    from mujoco_joint import write_logs

    model, real = write_logs(tmp_path)
    result = ta.diagnose(ta.read_runs(real), simulated=model)
    found = {finding.cause: finding.parameters for finding in result.findings if finding.confirmed}
    assert found.keys() == {"missing_order", "backlash"}
    assert found["missing_order"]["order"].value == 2
    assert found["missing_order"]["amplitude_arcsec"].value == pytest.approx(40.0, abs=1.0)
    assert found["backlash"]["half_width_arcsec"].value == pytest.approx(6.0, abs=0.3)
