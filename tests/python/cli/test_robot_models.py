"""Which joints of a robot get a correction model: those of which something is confirmed."""

from types import SimpleNamespace

import pytest

import trueangle as ta
from trueangle.cli import main

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
