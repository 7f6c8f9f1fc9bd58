"""A fleet through every door: runs, files, folders, the command, its file and its picture."""

import json
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError

from .made import MEAN, units

SEED = 52_050


@pytest.fixture(scope="module")
def runs():
    print("seed", SEED)
    rng = np.random.default_rng(SEED)

    def eccentric(u, t, b):
        return b + np.array([[90.0, 0.0]] + 3 * [[0.0, 0.0]]) * (u == 3), 0.0

    return units(rng, 12, change=eccentric, runs=2)


@pytest.fixture
def table(runs, tmp_path):
    path = tmp_path / "fleet.csv"
    lines = ["unit,run,reference_deg,indicated_deg"]
    for run in runs:
        rows = zip(run.reference, run.indicated, strict=True)
        lines += [f"{run.unit},{run.label},{x!r},{y!r}" for x, y in rows]
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")
    return path


def test_a_file_and_runs_give_one_answer(runs, table):
    one, other = ta.fleet(runs, orders=range(1, 5)), ta.fleet(table, orders=range(1, 5))
    assert one.verdicts() == other.verdicts()
    assert one.prior.mean == pytest.approx(other.prior.mean, abs=1e-12)
    assert one.to_json() == ta.fleet([*runs], orders=range(1, 5)).to_json()


def test_orders_are_those_above_the_noise(runs):
    found = ta.fleet(runs)
    assert found.orders == (1.0, 2.0, 3.0, 4.0)
    assert found.common[0].cosine == pytest.approx(MEAN[0][0] / 3600.0, abs=15.0 / 3600.0)
    assert found.between[0].std == pytest.approx(10.0 / 3600.0, rel=0.5)
    # One run of 180 readings of 3 arcsec: each coefficient to 3 sqrt(2 / 180).
    assert found.between[0].repeatability == pytest.approx(0.316 / 3600.0, rel=0.4)


def test_arbitrary_zeros_have_no_common_pattern():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    found = ta.fleet(units(rng, 20, aligned=False), orders=[1, 2])
    assert not found.aligned
    assert all(row.amplitude == 0.0 for row in found.common)


def test_without_units_the_runs_are_units(runs):
    plain = [
        ta.CalibrationRun(r.reference, r.indicated, 360.0, label=f"{r.unit}{r.label}") for r in runs
    ]
    found = ta.fleet(plain, orders=[1, 2])
    assert len(found.units) == len(runs)
    assert any("every run is treated as a unit" in note for note in found.notes)
    assert len(ta.fleet(runs, by="run", orders=[1]).units) == 2


def test_files_without_a_column_are_units_where_they_are_more_than_the_labels(runs, tmp_path):
    """A file a unit with runs r0, r1 in each, and dates in folders; and a file a date."""
    again = [replace(run, when="2026-07-10") for run in runs]
    for folder, those in (("spring", runs), ("autumn", again)):
        for run in those:
            path = tmp_path / folder / f"{run.unit}.csv"
            path.parent.mkdir(exist_ok=True)
            lines = [] if path.exists() else ["run,when,reference_deg,indicated_deg"]
            rows = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
            lines += [f"{run.label},{run.when or '2026-01-10'},{x!r},{y!r}" for x, y in rows]
            with path.open("a") as file:
                file.write("\n".join(lines) + "\n")
    found = ta.fleet([tmp_path / "spring", tmp_path / "autumn"], orders=[1, 2])
    assert set(found.verdicts()) == {run.unit for run in runs}
    assert any("every file" in note for note in found.notes)
    assert len(found.history) == 12
    for name, when in (("a", "2026-01-10"), ("b", "2026-07-10")):
        lines = ["run,when,reference_deg,indicated_deg"]
        for run in runs[::2]:
            rows = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
            lines += [f"{run.unit},{when},{x!r},{y!r}" for x, y in rows]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    found = ta.fleet([tmp_path / "a.csv", tmp_path / "b.csv"], orders=[1, 2])
    assert set(found.verdicts()) == {run.unit for run in runs}
    assert any("every run" in note for note in found.notes)


def test_it_is_saved_and_read_back(runs, tmp_path):
    found = ta.fleet(runs, orders=range(1, 5))
    found.save(tmp_path / "fleet.json")
    again = ta.load_fleet(tmp_path / "fleet.json")
    assert (again.prior.mean == found.prior.mean).all()
    assert (again.prior.variance == found.prior.variance).all()
    assert again.verdicts() == found.verdicts()
    assert again.summary() == found.summary()
    again.save(tmp_path / "again.json")
    first, second = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("fleet", "again"))
    assert first["prior"] == second["prior"]


def test_what_runs_differ_by_is_saved_and_read_back(runs, tmp_path):
    found = ta.fleet(runs, orders=[1, 2])
    assert found.prior.run_variance is None
    known = replace(found.prior, run_variance=np.array([1e-6, 1e-6, 0.0, 0.0]))
    replace(found, prior=known).save(tmp_path / "fleet.json")
    again = ta.load_fleet(tmp_path / "fleet.json").prior
    assert (again.run_variance == known.run_variance).all()
    turned = again.among(again.shafts[::-1])
    assert (turned.run_variance == known.run_variance).all()
    content = json.loads((tmp_path / "fleet.json").read_text())
    content["prior"]["run_variance"] = [1e-6]
    (tmp_path / "fleet.json").write_text(json.dumps(content))
    with pytest.raises(FileError, match=r"prior\.run_variance"):
        ta.load_fleet(tmp_path / "fleet.json")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda c: c.pop("prior"), "prior"),
        (lambda c: c.update(version=9), "version"),
        (lambda c: c.update(format="trueangle-model"), "format"),
        (lambda c: c["prior"].update(variance=[1.0]), "prior.variance"),
        (lambda c: c["prior"].update(period=-1.0), "prior.period"),
        (lambda c: c["prior"].update(noise_variance=0.0), "prior.noise_variance"),
        (lambda c: c["units"][0].update(verdict="well"), "units[0].verdict"),
        (lambda c: c["units"][0]["orders"][0].update(amplitude_arcsec=-1.0), "amplitude"),
        (lambda c: c["common"].update(aligned=1), "common.aligned"),
        (lambda c: c["between"]["orders"].pop(), "key 'between.orders'"),
        (lambda c: c.update(more=1), "more"),
    ],
)
def test_a_damaged_file_is_refused_by_its_key(change, told, runs, tmp_path):
    path = tmp_path / "fleet.json"
    ta.fleet(runs, orders=[1, 2]).save(path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=told.replace("[", r"\[")):
        ta.load_fleet(path)


def test_the_command_prints_the_object_and_writes_a_prior(table, tmp_path, capsys, runs):
    fleet = str(tmp_path / "fleet.json")
    assert main(["fleet", str(table), "--orders", "1-4", "-o", fleet, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert {"units", "common", "between", "tolerance", "history", "notes"} == set(printed)
    assert printed["units"][0]["unit"] == "u3"
    assert printed["units"][0]["verdict"] == "outlier"
    assert set(printed["units"][0]["orders"][0]) == {
        "order", "amplitude_arcsec", "phase_deg", "std_arcsec", "z",
    }  # fmt: skip
    unit = tmp_path / "unit.csv"
    rows = [
        f"{x},{y}" for x, y in zip(runs[0].reference[::18], runs[0].indicated[::18], strict=True)
    ]
    unit.write_text("\n".join(["reference_deg,indicated_deg", *rows]) + "\n")
    model = str(tmp_path / "unit.json")
    assert main(["fit", str(unit), "--prior", fleet, "-o", model, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["prior"]["units"] == 11
    assert ta.load_model(model).orders == (1.0, 2.0, 3.0, 4.0)
    assert main(["fleet", str(table)]) == 0
    assert "u3" in capsys.readouterr().out
    assert main(["fit", str(unit), "--prior", fleet, "--one-pass", "-o", model]) == 1
    assert "--prior goes with readings in memory" in capsys.readouterr().err


def test_what_is_no_fleet_is_refused(runs):
    with pytest.raises(ArgumentError, match="share must lie"):
        ta.fleet(runs, share=1.0)
    with pytest.raises(ArgumentError, match="permitted_arcsec must be positive"):
        ta.fleet(runs, permitted_arcsec=-1.0)
    with pytest.raises(ArgumentError, match="by must be"):
        ta.fleet(runs, by="joint")
    with pytest.raises(ArgumentError, match="orders is empty"):
        ta.fleet(runs, orders=[])
    short = [ta.CalibrationRun([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 360.0, unit="a")]
    with pytest.raises(ArgumentError, match="no unit has readings"):
        ta.fleet(short, orders=[1, 2])
    turns = ta.CalibrationRun(runs[0].reference / 360.0, runs[0].indicated / 360.0, 1.0, unit="b")
    with pytest.raises(ArgumentError, match="different units"):
        ta.fleet([runs[0], turns], orders=[1])


def test_the_picture_names_who_is_not_fine(runs):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    from trueangle.plots import text_alternative

    found = ta.fleet(runs, orders=[1, 2])
    for options in (
        {}, {"kind": "patterns"}, {"kind": "phasors", "order": 1}, {"kind": "sizes"},
    ):  # fmt: skip
        ax = found.plot(**options)
        ax.figure.canvas.draw()
        assert ax.figure.axes
        texts = [t.get_text() for axes in ax.figure.axes for t in (*axes.texts, axes.title)]
        assert any("u3" in text for text in texts)
    assert "u3" in text_alternative(found.plot())
    pyplot.close("all")
    with pytest.raises(ArgumentError, match="order must be one of 1, 2"):
        found.plot("phasors", order=7)
    with pytest.raises(ArgumentError, match="kind must be"):
        found.plot("pie")
    with pytest.raises(ArgumentError, match="unit must be"):
        found.plot("history", unit="u3")
