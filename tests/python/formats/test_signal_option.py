"""``--signal [JOINT.]ROLE=NAME[:UNIT]`` in the commands."""

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError

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
