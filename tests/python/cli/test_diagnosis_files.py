"""Files of a diagnosis: what is told of each that is written, and of a torque ripple."""

from types import SimpleNamespace

import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.cli.diagnose import _written
from trueangle.errors import FileError, NoModelError


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
        ["knee", "20.00", "-", "simulation", "is", "enough", "-"],
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
