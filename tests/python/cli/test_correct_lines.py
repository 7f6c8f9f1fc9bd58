"""What is printed of logs one by one and together, against counts written out."""

import argparse
import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.cli.correct import _print, _status, _total
from trueangle.cli.diagnose import _written
from trueangle.cli.watch import _line
from trueangle.errors import FileError, NoModelError, TrueAngleError
from trueangle.logs.report import BatchReport, LogReport
from trueangle.model.monitor import WatchedOrder, WatchedWindow

SEED = 81_300
STATUS = ("done", "done before", "failed", "not started")


def joint(rms, largest, missing=0, outside=None):
    return {
        "joint": None, "column": "q", "corrected": "corrected_deg",
        "rms_correction_arcsec": rms, "max_abs_correction_arcsec": largest,
        "missing": missing, "outside_span": outside, "unit_note": None,
    }  # fmt: skip


def log(number, status, rows):
    path, made = Path(f"log{number}.csv"), Path(f"out/log{number}.csv")
    result = {"rows": rows, "rows_per_second": 1e6, "joints": [joint(1.0, 2.0)], "after": {}}
    error = FileError(path, f"is damaged at byte {number}") if status == "failed" else None
    return LogReport(path, made, 100, status, result if status.startswith("done") else {}, error)


def batches():
    """Batches of unlike numbers of logs of each kind."""
    rng = np.random.default_rng(SEED)
    for counts in itertools.product((0, 1, 2, 7), (0, 1, 3), (0, 1, 2, 6, 9), (0, 2)):
        if sum(counts) < 2:
            continue
        kinds = [s for s, n in zip(STATUS, counts, strict=True) for _ in range(n)]
        rng.shuffle(kinds)
        rows = rng.integers(1, 1000, len(kinds)).tolist()
        yield (
            counts,
            BatchReport(
                [log(k, s, n) for k, (s, n) in enumerate(zip(kinds, rows, strict=True))], 2.0
            ),
        )


def test_logs_together_are_those_of_this_time(capsys):
    """What was done before is told apart, and its readings are not counted again."""
    for (done, before, failed, waiting), batch in batches():
        rows = sum(one.result["rows"] for one in batch.logs if one.status == "done")
        assert batch.to_dict()["rows"] == rows
        assert batch.to_dict()["complete"] == (failed + waiting == 0)
        _total(batch)
        total = done + before + failed + waiting
        more = f", {before} already" if before else ""
        wanted = f"{done} of {total} logs corrected{more}: {rows} readings in 2.0 s\n"
        assert capsys.readouterr().out == wanted


def test_what_is_not_done_is_counted_and_named():
    for (done, before, failed, waiting), batch in batches():
        if failed + waiting == 0:
            assert _status(batch) == 0
            continue
        with pytest.raises(TrueAngleError) as found:
            _status(batch)
        text = str(found.value)
        total = done + before + failed + waiting
        assert text.startswith(f"{done + before} of {total} logs are corrected and complete")
        named = text.count("is damaged at byte")
        more = [part for part in text.split("; ") if part.endswith(" more failed")]
        assert named + sum(int(part.split()[0]) for part in more) == failed
        assert (named == failed) == (not more)
        assert ("not started: " in text) == (waiting > 0)
        assert text.endswith("; run the same command again to go on")


@pytest.mark.parametrize(("largest", "unit"), [(3590.0, "arcsec"), (3610.0, "deg")])
@pytest.mark.parametrize("share", [0.1, 0.7])
def test_a_correction_is_in_the_unit_that_its_largest_has(share, largest, unit, capsys):
    one = log(0, "done", 500)
    one.result["joints"][:] = [joint(share * largest, largest, 3, 7), joint(1.0, 2.0)]
    _print(one, "auto")
    first, second, third = capsys.readouterr().out.splitlines()
    assert first == "log0.csv: 500 readings corrected at 1,000,000 rows/s -> out/log0.csv"
    scale = 1.0 if unit == "arcsec" else 1.0 / 3600.0
    words = second.split()
    assert float(words[2]) == pytest.approx(share * largest * scale, rel=1e-3)
    assert words[3] == unit
    assert float(words[5]) == pytest.approx(largest * scale, rel=1e-3)
    assert second.endswith(
        "max abs, 3 missing kept, 7 outside the calibrated span, where no reading verifies it"
    )
    assert third.endswith("max abs")
    before = log(1, "done before", 5)
    _print(before, "auto")
    assert capsys.readouterr().out == "log1.csv: done before -> out/log1.csv\n"
    _print(log(2, "failed", 0), "auto")
    assert capsys.readouterr().out == ""


TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "count": 8192.0}
ARCSEC = 1_296_000.0
SIZE = 2372.0

#: What a size of 2372 arcsec is in each unit, of 8192 counts to a turn or of 4096 asked for.
SHOWN = {
    ("auto", None): (SIZE, "arcsec"),
    ("arcsec", None): (SIZE, "arcsec"),
    ("deg", None): (SIZE / 3600.0, "deg"),
    ("mrad", None): (SIZE / ARCSEC * 2000.0 * np.pi, "mrad"),
    ("count", 4096.0): (SIZE / ARCSEC * 4096.0, "count"),
    ("count", None): (SIZE / ARCSEC * 8192.0, "count"),
}


def window(turn, alarm=False, scale=1.0):
    """Order 3 is the largest, and neither the first nor that with the largest sum."""
    orders = tuple(
        WatchedOrder(order, part * scale * SIZE * turn / ARCSEC, 10.0, statistic)
        for order, part, statistic in ((1.0, 0.2, 4.0), (3.0, 1.0, 2.0), (2.0, 0.9, 9.0))
    )
    because = "order 2 by 2134.8 arcsec since window 3" if alarm else ""
    return WatchedWindow(7, 0.0, None, 90, orders, 9.0, 8.5, alarm, because)


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize("asked", list(SHOWN), ids=str)
def test_a_size_is_in_the_unit_asked_for(asked, readings):
    turn, (name, counts) = TURNS[readings], asked
    if name == "count" and counts is None and readings != "count":
        return
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in=name, counts_per_turn=counts)
    value, unit = SHOWN[asked]
    for alarm in (False, True):
        line = _line(window(turn, alarm), model, args)
        found = re.match(r"window +7  order 3 is off by (\S+) (\w+); baseline 7 of 8", line)
        assert float(found[1]) == pytest.approx(value, rel=1e-3)
        assert found[2] == unit
        assert ("ALARM" in line) == alarm
        if alarm:
            told = re.search(r"ALARM order 2 by (\S+) (\w+) since window 3", line)
            assert float(told[1]) == pytest.approx(0.9 * value, rel=2e-3)
            assert told[2] == unit


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize(("scale", "unit"), [(3590.0 / SIZE, "arcsec"), (3610.0 / SIZE, "deg")])
def test_by_itself_it_is_in_degrees_from_one_on(scale, unit, readings):
    turn = TURNS[readings]
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in="auto", counts_per_turn=None)
    assert f" {unit}; baseline" in _line(window(turn, scale=scale), model, args)
    args.json = True
    plain = json.loads(_line(window(turn, scale=scale), model, args))
    sizes = [row["amplitude_arcsec"] for row in plain["orders"]]
    np.testing.assert_allclose(sizes, np.array([0.2, 1.0, 0.9]) * scale * SIZE)


@pytest.fixture
def exported(monkeypatch):
    """What an export is asked for."""
    found = {}

    def export(sensor, target, path, **more):
        found.update(more, sensor=sensor, target=target)
        return SimpleNamespace(output=path)

    monkeypatch.setattr("trueangle.export.export_model", export)
    return found


def written(capsys, ripple=(), runs=(), nothing=False, **asked):
    """The lines that are printed with these files asked for."""

    def sensor(without_any):
        if nothing and not without_any:
            raise NoModelError("nothing to correct")
        return "empty" if nothing else "sensor"

    names = ("extend", "plan", "extend_into", "corrected_model", "into_joint")
    args = SimpleNamespace(**dict.fromkeys(names), json=False, argument="auto")
    vars(args).update(asked)
    save = SimpleNamespace(save=lambda path: None)
    result = SimpleNamespace(
        torque=SimpleNamespace(ripple=list(ripple)), sensor=sensor, sensor_noise=lambda: 2e-6,
        next_runs=SimpleNamespace(runs=list(runs), save=save.save), simulation=lambda: save,
        correction=lambda *_, **__: save, findings=[],
    )  # fmt: skip
    _written(result, args, None)
    return capsys.readouterr().out


LEFT = "; the torque ripple is not in it: a file of MuJoCo (.xml) has a place for it"


@pytest.mark.parametrize("ripple", [(), ("6:0.2:30",)])
def test_a_ripple_has_its_place_in_a_file_of_mujoco_alone(ripple, exported, capsys):
    told = written(capsys, ripple, extend_into="s.fmu")
    assert told == f"\nSensor of what is confirmed: s.fmu{LEFT if ripple else ''}\n"
    assert exported == {
        "sensor": "sensor", "target": "fmu", "noise_std": 2e-6, "variant": "sensor",
    }  # fmt: skip
    exported.clear()
    told = written(capsys, ripple, extend_into="s.xml", into_joint="knee")
    assert told == "\nSensor of what is confirmed: s.xml\n"
    assert exported == {
        "sensor": "sensor", "target": "mujoco", "noise_std": 2e-6, "joint": "knee",
        "ripple": list(ripple) or None,
    }  # fmt: skip


def test_a_ripple_alone_is_a_file_of_mujoco(exported, capsys):
    assert written(capsys, ("6:1:0",), nothing=True, extend_into="s.xml").endswith("s.xml\n")
    assert (exported["sensor"], exported["joint"]) == ("empty", "joint")
    with pytest.raises(NoModelError) as found:
        written(capsys, ("6:1:0",), nothing=True, extend_into="s.FMU")
    assert str(found.value) == (
        "nothing to correct; a torque ripple is for MuJoCo: --extend-into sensor.xml"
    )
    for path in ("s.xml", "s.fmu"):
        with pytest.raises(NoModelError, match=r"^nothing to correct$"):
            written(capsys, nothing=True, extend_into=path)


def test_every_file_is_told_in_its_order(exported, capsys):
    told = written(
        capsys, runs=[1], extend="e.toml", plan="p.toml", extend_into="s.xml",
        corrected_model="c.json",
    )  # fmt: skip
    assert told.split("\n\n") == [
        "\nExtended simulation: e.toml", "Runs to measure next: p.toml",
        "Sensor of what is confirmed: s.xml", "Correction model: c.json\n",
    ]  # fmt: skip


@pytest.mark.parametrize("runs", [None, ()])
def test_a_plan_without_runs_is_not_written(runs, capsys):
    with pytest.raises(ValueError, match=r"^no further run would .* anything: p\.toml not"):
        written(capsys, runs=runs or (), plan="p.toml")


def test_every_file_that_cannot_be_written_is_told_once(capsys):
    """The last as the error of the command, those before as lines of their own."""

    def refused(path):
        raise FileError(path, "the folder is read only")

    out = SimpleNamespace(save=refused)
    result = SimpleNamespace(
        simulation=lambda: out, correction=lambda *_, **__: out, findings=[], torque=None,
        next_runs=SimpleNamespace(runs=[1], save=refused),
    )  # fmt: skip
    files = {"extend": "e.toml", "plan": "p.toml", "corrected_model": "c.json"}
    args = SimpleNamespace(**files, extend_into=None, into_joint=None, json=False, argument="auto")
    with pytest.raises(FileError, match=r"^c\.json: "):
        _written(result, args, None)
    assert capsys.readouterr() == (
        "",
        "trueangle: error: e.toml: the folder is read only\n"
        "trueangle: error: p.toml: the folder is read only\n",
    )


#: Whether findings of each joint are confirmed.
JOINTS = {"hip": [True, False], "knee": [False, False, False], "ankle": [], "toe": [False, True]}


@pytest.fixture
def leg(tmp_path, monkeypatch):
    """A log of four joints, whose diagnoses find what is listed."""
    monkeypatch.chdir(tmp_path)
    columns = [f"{name}_{role}" for name in JOINTS for role in ("ref", "enc")]
    rows = [",".join(columns), *(",".join([str(9 * k)] * len(columns)) for k in range(20))]
    (tmp_path / "leg.csv").write_text("\n".join(rows) + "\n")
    asked = []

    def diagnosed(*_, **__):
        found = [SimpleNamespace(confirmed=c, cause=f"cause{k}") for k, c in
                 enumerate(JOINTS[list(JOINTS)[len(asked)]])]  # fmt: skip
        number = len(asked) + 1

        def correction(argument):
            shaft = ta.Shaft("output", 1, [1], [0.0], [0.001 * number])
            return ta.HarmonicModel([shaft], period=360.0, argument=argument)

        asked.append(number)
        return SimpleNamespace(
            findings=found, unexplained=None, gain={}, correction=correction,
            in_question=(), factors=(),
            discrepancy=SimpleNamespace(peak_to_peak=10.0 * number),
            summary=lambda *_, **__: f"account {number}", to_dict=lambda: {"number": number},
        )  # fmt: skip

    monkeypatch.setattr("trueangle.diagnosis.diagnose", diagnosed)
    named = [f"--signal={n}.{role}={n}_{c}:deg" for n in JOINTS
             for role, c in (("reference", "ref"), ("indicated", "enc"))]  # fmt: skip
    return ["diagnose", "leg.csv", *named, "--corrected-model", "c.json"]


def test_joints_are_ranked_and_those_with_a_cause_are_corrected(leg, capsys):
    assert main([*leg, "--argument", "indicated"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert [line.split() for line in told[3:7]] == [
        ["toe", "40.00", "-", "explained", "cause1"],
        ["ankle", "30.00", "-", "simulation", "is", "enough", "-"],
        ["knee", "20.00", "-", "differs,", "not", "named", "-"],
        ["hip", "10.00", "-", "explained", "cause0"],
    ]
    assert [line for line in told[7:] if line] == [
        "--- toe ---", "account 4", "--- ankle ---", "account 3", "--- knee ---", "account 2",
        "--- hip ---", "account 1", "Correction models of hip, toe: c.json",
    ]  # fmt: skip
    robot = ta.load_robot("c.json")
    assert {name: robot[name].amplitudes.tolist() for name in robot} == {
        "hip": [0.001], "toe": [pytest.approx(0.004)],
    }  # fmt: skip
    assert {robot[name].argument for name in robot} == {"indicated"}


def test_without_a_confirmed_cause_nothing_is_written(leg, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(JOINTS, "hip", [False])
    monkeypatch.setitem(JOINTS, "toe", [])
    assert main([*leg, "--json"]) == 1
    out, err = capsys.readouterr()
    assert '"number": 4' in out
    assert err == (
        "trueangle: error: no cause of any joint is confirmed: there is nothing to correct\n"
    )
    assert not (tmp_path / "c.json").exists()
