"""Selection of orders on measured data, and its command."""

import importlib.util
import json
import math

import numpy as np
import pytest

import trueangle as ta
from conftest import ROOT
from trueangle.cli import main
from trueangle.cli.demo import JOINT_A, lifted, simulated_groups


def write(path, runs):
    lines = ["run,reference_deg,indicated_deg"]
    for run in runs:
        lines += [
            f"{run.label},{r!r},{i!r}"
            for r, i in zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        ]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def test_rm44_repeat(data_dir):
    runs = ta.read_runs(data_dir / "rm44_repeat.csv")
    chosen = ta.select_orders(runs)
    columns = [np.radians(np.outer(run.reference, range(1, 6))) for run in runs]
    columns = [np.hstack([np.ones((len(x), 1)), np.cos(x), np.sin(x)]) for x in columns]
    errors = [ta.wrap(run.indicated - run.reference, run.period) for run in runs]
    each = [np.linalg.lstsq(x, y)[0][1:] for x, y in zip(columns, errors, strict=True)]
    scatter = np.std(each, axis=0, ddof=1).reshape(2, 5) / math.sqrt(len(runs))
    assert set(range(1, 6)) <= set(chosen.orders)
    assert not {6, 10, 11} & set(chosen.orders)
    for order, amplitude in zip(range(1, 6), (0.42, 0.13, 0.15, 0.28, 0.08), strict=True):
        row = chosen.row(order)
        assert row.amplitude == pytest.approx(amplitude, abs=0.005)
        # Near 0.0006 deg: the scatter of the runs, not the white noise, which alone makes 0.0001.
        wanted = math.hypot(*scatter[:, order - 1]) / math.sqrt(2.0)
        assert row.standard_error == pytest.approx(wanted, rel=0.3)
    # Order 6 repeats, but changes a reading by a fifteenth of its scatter.
    assert not chosen.row(6).retained


def test_rm44_misalignment(data_dir):
    spec = importlib.util.spec_from_file_location("ex", ROOT / "examples" / "misalignment.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    by_axis = {"xd": [], "xs": []}
    for run in ta.read_runs(data_dir / "rm44_misalignment.csv"):
        axis = run.columns["stage_axis"][0]
        if axis in by_axis:
            offset = float(run.columns["stage_offset_um"][0])
            by_axis[axis].append((offset, *(a for a, _, _ in example.amplitudes(run))))
    magnet, sensor = (np.array(sorted(by_axis[axis])) for axis in ("xd", "xs"))
    assert magnet[-1, 1] > 5.0 * magnet[0, 1]
    assert sensor[-1, 2] > 20.0 * sensor[0, 2]
    # Beyond the centre each grows from offset to offset.
    assert np.corrcoef(magnet[:, 0], magnet[:, 1])[0, 1] > 0.9
    assert np.corrcoef(sensor[:, 0], sensor[:, 2])[0, 1] > 0.95


def test_stepper_steps_are_the_references_own(data_dir):
    runs = ta.read_runs(data_dir / "stepper_encoder_units.csv")
    chosen = ta.select_orders(runs[0], candidates=range(1, 121), reference_orders=(50, 100))
    for order, words in (
        (50, "as declared"),
        (100, "as declared"),
        (48, "side band -2 of its order 50"),
        (52, "side band +2 of its order 50"),
    ):
        row = chosen.row(order)
        assert row.verdict == "reference"
        assert words in row.reason
        assert order not in chosen.orders
    assert {1, 2} <= set(chosen.orders)
    # Undeclared, they are orders like any others.
    assert 50 in ta.select_orders(runs[0], candidates=range(1, 121)).orders


def test_the_arm_on_part_of_a_turn_and_the_resolver_are_no_trouble(data_dir):
    for run in ta.read_runs(data_dir / "arm_joint_protractor.csv"):
        assert ta.select_orders(run).orders
    (run,) = ta.read_runs(data_dir / "resolver_stepper.csv")
    chosen = ta.select_orders(run, candidates=range(1, 121))
    assert {4, 8, 12, 16, 20, 24, 50, 100} <= set(chosen.orders)


def test_command_prints_the_contracts_json(tmp_path, capsys):
    path = write(tmp_path / "joint.csv", simulated_groups(lifted(JOINT_A)))
    assert main(["orders", path, "--gear-ratio", "100", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["distinct_positions"], found["samples"], found["runs"]) == (36, 216, 6)
    assert found["noise_arcsec"] == pytest.approx(6.03, rel=0.2)
    rows = {row["order"]: row for row in found["orders"]}
    row = rows[14]
    assert row["retained"] is True
    assert row["aliases"][:4] == [22, 50, 58, 86]
    assert 202 in row["aliases"]
    assert row["explanations"] == ["202 (tooth mesh with the circular spline)"]
    assert row["amplitude_arcsec"] == pytest.approx(33.36, abs=4 * row["std_arcsec"])
    assert row["phase_deg"] == pytest.approx(20.82, abs=4 * row["phase_std_deg"])
    assert 0.9 < row["holdout_gain"] <= 1.0
    assert row["phase_spread_deg"] < 20.0
    assert rows[2]["retained"] is False
    assert rows[2]["reason"]


def test_command_prints_text_and_passes_its_arguments(tmp_path, capsys):
    path = write(tmp_path / "joint.csv", simulated_groups(lifted(JOINT_A)))
    assert main(["orders", path, "--gear-ratio", "100"]) == 0
    text = capsys.readouterr().out
    assert "14 may be 202 (tooth mesh with the circular spline)" in text
    assert main(["orders", path, "--method", "paper", "--orders", "1-17"]) == 0
    assert "rms (the last run)" in capsys.readouterr().out
    assert main(["orders", path, "--reference-orders", "14", "--json"]) == 0
    rows = {row["order"]: row for row in json.loads(capsys.readouterr().out)["orders"]}
    assert rows[14]["verdict"] == "reference"
    assert main(["orders", path, "--run", "z"]) == 1
    assert "no such run" in capsys.readouterr().err
