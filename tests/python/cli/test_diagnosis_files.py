"""Files of a diagnosis: what is told of each that is written, and of a torque ripple."""

from types import SimpleNamespace

import pytest

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
