"""Results as plain values: in Python what the command line prints with ``--json``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.planning import plan_mounts, plan_self
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plain")
    runs = tuple(RunDesign(str(k), samples=180, spacing="jittered") for k in range(3))
    sim = Simulation(
        Joint(gear_ratio=30.0), (Harmonic("output", 2, 40.0, 70.0),), sigma_arcsec=1.0, runs=runs
    )
    ta.write_runs(ta.simulate(sim, 71), place / "runs.csv")
    model = ta.fit(ta.read_runs(place / "runs.csv"), orders=[2]).model
    model.save(place / "model.json")
    return place


def printed(capsys: pytest.CaptureFixture[str], *words: str | Path) -> dict[str, object]:
    assert main([str(word) for word in words]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_fit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs, output = folder / "runs.csv", folder / "again.json"
    said = printed(capsys, "fit", runs, "-o", output, "--orders", "1-3", "--json")
    assert said.pop("model") == str(output)
    assert json.loads(ta.fit(ta.read_runs(runs), orders=range(1, 4)).to_json()) == said


def test_a_selection(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = folder / "runs.csv"
    said = printed(capsys, "orders", runs, "--orders", "1-9", "--json")
    chosen = ta.select_orders(ta.read_runs(runs), candidates=range(1, 10))
    assert json.loads(chosen.to_json()) == said


def test_a_check(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = printed(capsys, "check", folder / "runs.csv", "--json")
    assert json.loads(ta.check(folder / "runs.csv").to_json()) == said


def test_a_comparison(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = folder / "model.json"
    said = printed(capsys, "compare", model, model, "--json")
    assert json.loads(ta.compare(model, model).to_json()) == said


def test_an_export(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = folder / "table.h"
    said = printed(
        capsys,
        "export",
        folder / "model.json",
        "--to",
        "c",
        "-o",
        output,
        "--entries",
        64,
        "--json",
    )
    made = ta.export_model(ta.load_model(folder / "model.json"), "c", output, entries=64)
    assert json.loads(made.to_json()) == said


@pytest.mark.parametrize("own", [False, True])
def test_a_plan(own: bool, capsys: pytest.CaptureFixture[str]) -> None:
    if own:
        said = printed(capsys, "plan", "--self", "heads", "--orders", "1-4", "--json")
        plan = plan_self("heads", orders=range(1, 5))
    else:
        said = printed(
            capsys, "plan", "--gear-ratio", "100", "--positions", "36", "--mounts", "3", "--json"
        )
        plan = plan_mounts(100.0, 36, 3)
    assert json.loads(plan.to_json()) == said


def test_phases_count_from_0_to_360_everywhere(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, back = folder / "phases.csv", folder / "back.json"
    base = ta.load_model(folder / "model.json")
    shafts = (ta.Shaft("output", 1.0, (1, 2, 3), (3e-3, -3e-3, -3e-3), (-4e-3, -4e-3, 4e-3)),)
    model = ta.HarmonicModel(shafts, period=base.period, constant=0.0)
    ta.export_model(model, "csv", table)
    said = printed(capsys, "import", table, "--from", "csv", "-o", back, "--json")
    compared = ta.compare(base, model).to_dict()
    for row in [*said["orders"], *compared["orders"]]:  # type: ignore[misc]
        assert 0.0 <= row["phase_deg"] < 360.0
    phases = {row["order"]: row["phase_deg"] for row in said["orders"]}  # type: ignore[attr-defined]
    for order, phase in zip((1.0, 2.0, 3.0), (143.130, 216.870, 323.130), strict=True):
        assert phases[order] == pytest.approx(phase, abs=0.1)
