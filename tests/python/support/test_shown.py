"""Every public result shows itself: one line as ``repr``, its summary as text and in notebooks."""

from __future__ import annotations

import html
import importlib
import json
import pickle
import pkgutil
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.planning import plan_mounts, plan_self
from trueangle.simulation import Backlash, Harmonic, Joint, RunDesign, Simulation
from trueangle.support.plainresult import ShownResult

#: Characters of one line of a screen.
LINE = 120

#: Characters of what a notebook keeps of a result, its picture included.
MOST = 150_000

#: Lines that a person reads of a result; the readings themselves are in none.
SCREENS = 400

SIM = Simulation(
    harmonics=(Harmonic("output", 1, 40.0, 30.0),),
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(label=f"{v:g}", samples=120, speed_deg_s=v, reversals=(0.5,)) for v in (5.0, 30.0)
    ),
)
RUNS = ta.simulate(SIM.with_effects([Backlash(20.0)]), seed=81)
FIT = ta.fit(RUNS, orders=[1, 2])


def diagnosed() -> ta.Diagnosis:
    return ta.diagnose(RUNS, SIM)


def moments() -> ta.Moments:
    found = ta.Moments([1, 2], period=360.0)
    found.update(RUNS[0].reference, RUNS[0].error)
    return found


def joined() -> object:
    table = {"time_s": RUNS[0].time, "reference_deg": RUNS[0].reference}
    other = {"time_s": RUNS[0].time, "indicated_deg": RUNS[0].indicated}
    return ta.join(other, table)


#: One of every kind that a public function returns.
MADE: dict[str, Callable[[], object]] = {
    "fit": lambda: FIT,
    "model": lambda: FIT.model,
    "robot": lambda: ta.Robot({"a": FIT.model}),
    "model with terms": lambda: diagnosed().correction(),
    "selection": lambda: ta.select_orders(RUNS),
    "diagnosis": diagnosed,
    "finding": lambda: diagnosed().findings[0],
    "gain": lambda: diagnosed().findings[0].gain,
    "belief": lambda: diagnosed().beliefs[0],
    "not identifiable": lambda: diagnosed().not_identifiable[0],
    "unexplained": lambda: diagnosed().unexplained,
    "discrepancy": lambda: diagnosed().discrepancy,
    "comparison": lambda: ta.compare(FIT.model, FIT.model),
    "check": lambda: ta.check(RUNS),
    "plan": plan_mounts,
    "plan of next runs": lambda: diagnosed().plan(between=["thermal_drift"]),
    "plan without a reference": lambda: plan_self("heads", orders=range(1, 5)),
    "fleet": lambda: ta.fleet(RUNS, orders=[1, 2]),
    "rehearsal": lambda: ta.rehearse(SIM, causes=["thermal_drift"], seeds=4, workers=1),
    "simulation": lambda: SIM,
    "export": lambda: ta.export_model(FIT.model, "csv"),
    "moments": moments,
    "monitor": lambda: ta.Monitor(FIT.model),
    "solved moments": lambda: moments().solve(),
}


@pytest.mark.parametrize("what", MADE)
def test_a_result_is_one_line_and_a_summary(what: str) -> None:
    made = MADE[what]()
    line, text = repr(made), str(made)
    assert "\n" not in line
    assert 0 < len(line) <= LINE, line
    assert type(made).__name__ in line
    assert "array(" not in text
    assert text.count("\n") < SCREENS
    summary = getattr(made, "summary", None)
    if summary is not None:
        assert text == summary()
    # In a notebook stand the same words and figures, in tables where the text has columns.
    shown = made._repr_html_()  # type: ignore[attr-defined]
    assert html.unescape(re.sub(r"<[^>]+>", " ", shown)).split() == text.split()
    assert len(shown) < MOST


#: Results that have tables, and those that have a picture, where matplotlib is installed.
TABLES = ("fit", "model", "selection", "comparison", "plan", "fleet")
PICTURES = ("fit", "model", "selection", "diagnosis", "fleet")


@pytest.mark.parametrize("what", TABLES)
def test_a_notebook_shows_columns_as_a_table(what: str) -> None:
    shown = MADE[what]()._repr_html_()  # type: ignore[attr-defined]
    rows = [re.findall(r"<t[dh]", row) for row in re.findall(r"<tr>.*?</tr>", shown)]
    assert max(map(len, rows)) >= 4


@pytest.mark.parametrize("what", PICTURES)
def test_a_notebook_shows_one_small_picture(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    before = pyplot.get_fignums()
    made = MADE[what]()
    assert len(re.findall(r'<img alt="[^"]{20,}"', made._repr_html_())) == 1  # type: ignore[attr-defined]
    # The notebook would show an open figure once more.
    assert pyplot.get_fignums() == before
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for loaded in [name for name in sys.modules if name.startswith("matplotlib.")]:
        monkeypatch.setitem(sys.modules, loaded, None)
    assert "<img" not in made._repr_html_()  # type: ignore[attr-defined]


def test_a_head_stands_over_its_columns() -> None:
    shown = re.sub(r' style="[^"]*"', "", FIT._repr_html_())
    assert "<th>amplitude</th><th>+-</th><th>phase</th><th>+-</th>" in shown
    assert "<th>arcsec</th><th>arcsec</th><th>deg</th><th>deg</th>" in shown
    shown = re.sub(r' style="[^"]*"', "", ta.select_orders(RUNS)._repr_html_())
    assert "<th>probability</th><th>held out</th><th>verdict</th>" in shown
    assert "<th></th><th>gain, %</th><th></th>" in shown


def test_the_line_tells_what_matters() -> None:
    found = diagnosed()
    assert "backlash" in repr(found)
    assert "240 readings" in repr(found)
    assert repr(found.findings[0]).startswith("Finding(backlash, half_width_arcsec ")
    assert "usable" in repr(ta.check(RUNS))


def returns_text(method: object) -> bool:
    return getattr(method, "__annotations__", {}).get("return") == "str"


def test_every_public_result_class_shows_itself() -> None:
    """Whoever has a summary or plain values has the three ways of showing them."""
    found = set()
    for module in pkgutil.walk_packages(ta.__path__, "trueangle."):
        if ".cli" in module.name or module.name.endswith("__main__"):
            continue
        try:
            loaded = importlib.import_module(module.name)
        except ImportError:
            continue  # an extra that is not installed
        for value in vars(loaded).values():
            if isinstance(value, type) and value.__module__.startswith("trueangle."):
                found.add(value)
    results = {kind for kind in found if returns_text(getattr(kind, "summary", None))}
    assert len(results) > 10
    for kind in sorted(results, key=lambda kind: kind.__qualname__):
        assert issubclass(kind, ShownResult), kind
        assert "__str__" not in kind.__dict__, f"{kind}: its text is its summary"
    for kind in found:
        if issubclass(kind, ShownResult) and "__dataclass_fields__" in kind.__dict__:
            own = kind.__dict__["__repr__"]
            assert own.__qualname__.startswith((kind.__qualname__, "Shown")), kind


def test_names_in_a_notebook_are_no_markup() -> None:
    run = ta.CalibrationRun(RUNS[0].reference, RUNS[0].indicated, 360.0, label="<b>&run")
    shown = ta.fit([run], orders=[1])._repr_html_()
    assert "<b>" not in shown


def test_what_shows_itself_is_pickled_as_before() -> None:
    again = pickle.loads(pickle.dumps(diagnosed()))
    assert str(again) == str(diagnosed())


def test_a_long_line_is_cut() -> None:
    wide = Simulation(
        runs=tuple(RunDesign(label="x" * 40) for _ in range(3)), sigma_arcsec=float(np.pi)
    )

    class Wordy(ShownResult):
        def _brief(self) -> str:
            return "word " * 100

    assert len(repr(wide)) <= LINE
    assert repr(Wordy()).endswith("...)")
    assert len(repr(Wordy())) <= LINE


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
