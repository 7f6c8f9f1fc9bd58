"""Content of the report against the results it comes from, and the page against the content."""

from __future__ import annotations

import dataclasses
import html
import json
import re
import sys

import numpy as np
import pytest

import trueangle as ta
from plots.strokes import strokes
from trueangle.cli import main
from trueangle.effects.effect import title_of
from trueangle.errors import ArgumentError, MissingExtraError
from trueangle.fitting.heldout import hold_out
from trueangle.joint.shafts import shaft_cycles
from trueangle.reports.modelled import known_gear, known_joint
from trueangle.reports.page import find_browser, print_pdf
from trueangle.reports.wording import formatted_number, lookup

from .conftest import ORDERS

#: Numbers that reached the content by another route than the page's may differ by rounding.
TINY = 1e-9


@pytest.fixture(scope="module")
def fit(runs) -> ta.FitResult:
    return ta.fit(runs, ORDERS, gear_ratio=100.0)


@pytest.mark.parametrize("shafts", [None, {"stepper": 7.5}, {"belt": 2.5, "worm": 90.0}])
@pytest.mark.parametrize("member", ["circular_spline", "flexspline", "none"])
@pytest.mark.parametrize("ratio", [None, 50.0])
def test_the_joint_of_a_report_has_the_shafts_that_were_told(ratio, member, shafts) -> None:
    known = known_joint(None, ratio, member, shafts)
    if known is None:
        assert ratio is None
        assert shafts is None
        assert known_gear(known) == {}
        return
    geared = {"output": 1.0} if ratio is None else shaft_cycles(ratio, member)
    assert known.shafts == geared | (shafts or {})
    fitted = known_gear(known)
    assert fitted.pop("shafts") == shafts
    assert fitted == ({} if ratio is None else {"gear_ratio": ratio, "fixed_member": member})


def test_coefficients_are_those_of_the_fit(made, fit: ta.FitResult) -> None:
    rows = made.content["model"]["coefficients"]
    assert [row["output_order"] for row in rows] == list(fit.orders)
    for key, values in (
        ("amplitude_arcsec", 3600.0 * fit.amplitudes),
        ("amplitude_std_arcsec", 3600.0 * fit.amplitude_std),
        ("phase_deg", np.degrees(fit.phases) % 360.0),
        ("phase_std_deg", np.degrees(fit.phase_std)),
    ):
        np.testing.assert_allclose([row[key] for row in rows], values, rtol=TINY)
    cov = np.diag(fit.covariance)[1:]
    stds = [row[k] for row in rows for k in ("cosine_std_arcsec", "sine_std_arcsec")]
    np.testing.assert_allclose(stds, 3600.0 * np.sqrt(cov), rtol=TINY)


def test_gain_is_the_held_out_gain(made, fit: ta.FitResult) -> None:
    held, gain = hold_out(fit), made.content["gain"]
    assert gain["before"]["rms_arcsec"] == pytest.approx(held.rms_before, rel=TINY)
    assert gain["after"]["rms_arcsec"] == pytest.approx(held.rms_after, rel=TINY)
    # Backlash of 8 and noise of 3 arcsec stay: sqrt(8^2 + 3^2) = 8.5.
    assert gain["after"]["rms_arcsec"] == pytest.approx(8.54, abs=0.2)


def test_held_out_run_does_not_enter_its_own_model(runs) -> None:
    held = hold_out(ta.fit(runs[:3], [1]))
    for i, run in enumerate(held.runs):
        others = [r for j, r in enumerate(runs[:3]) if j != i]
        assert run.model.amplitudes == pytest.approx(ta.fit(others, [1]).amplitudes, rel=TINY)


def test_faults_of_the_data_are_told_first(runs) -> None:
    twice = ta.CalibrationRun(runs[0].reference, runs[0].indicated, 360.0, label="again")
    made = ta.report([runs[0], twice, runs[1]], orders=[1])
    (fault,) = [f for f in made.content["data_faults"] if f["fault"] == "duplicate_runs"]
    first = made.html.split("Words used here")[0]
    assert fault["says"][1:] in html.unescape(first)


def test_one_run_has_no_gain_and_says_so(runs) -> None:
    made = ta.report(runs[:1], orders=[1])
    assert made.content["gain"] is None
    assert "One run only" in made.content["why_no_gain"]
    assert "Not verified" in made.html
    assert any("differences between runs" in e["what"] for e in made.content["unknowns"])


def test_a_reversed_sensor_is_stated_with_the_model(runs) -> None:
    words = "; the indicated angle is minus what the sensor reads"
    for sign in (1, -1):
        told = [dataclasses.replace(run, indicated_sign=sign) for run in runs[:1]]
        made = ta.report(told, orders=[1])
        assert made.content["model"]["indicated_sign"] == sign
        assert (words in made.html) == (sign < 0)


def test_unknowns_follow_from_the_conditions(runs) -> None:
    whats = [e["what"] for e in ta.report(runs, orders=[1]).content["unknowns"]]
    assert not any("delay" in w or "reversal" in w for w in whats)
    assert any("thermal" in w for w in whats)
    theta = np.arange(0.0, 360.0, 10.0)
    static = ta.CalibrationRun(theta, theta + 0.01 * np.sin(np.radians(theta)), period=360.0)
    whats = [e["what"] for e in ta.report(static, orders=[1]).content["unknowns"]]
    assert any("delay" in w for w in whats)
    assert any("reversal" in w for w in whats)


def page_numbers(page: str) -> list[tuple[str, float, int, str]]:
    """Path, factor, decimals and text of every number."""
    mark = r'<span data-path="([^"]+)"(?: data-per="([^"]+)")?>([^<]*)<'
    return [
        (path, float(per or 1.0), len(text.partition(".")[2]), html.unescape(text))
        for path, per, text in re.findall(mark, page)
    ]


def written(content: dict, path: str, per: float, digits: int) -> str:
    value = lookup(content, path)
    return formatted_number(None if value is None else value * per, digits)


def test_every_number_of_the_page_is_the_content(made) -> None:
    numbers = page_numbers(made.html)
    assert len(numbers) > 150
    for path, per, digits, text in numbers:
        assert text == written(made.content, path, per, digits), path


def test_no_number_stands_on_the_page_without_its_path(made) -> None:
    """Table cells that are numbers come from the content by path."""
    body = made.html.split("<main", 1)[1].split("</main>", 1)[0]
    bare = re.findall(r'<td class="r"[^>]*>([^<]+)</td>', body)
    assert not [cell for cell in bare if re.search(r"\d", cell)]


def test_page_carries_the_content_as_json(made) -> None:
    text = re.search(r'id="result">(.*?)</script>', made.html, re.S)
    assert json.loads(text[1]) == made.content


def test_text_is_escaped_and_nothing_is_fetched(made) -> None:
    assert "A &lt;joint&gt; &amp; its error" in made.html
    assert "<joint>" not in made.html
    outside = made.html.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r'(src|href)="(?!#|data:,)', outside)
    assert "http" not in re.sub(r"http-equiv", "", outside)


def test_every_figure_has_an_alternative_text_and_data(made) -> None:
    assert {"errors", "spectrum", "before-after", "phases"} <= set(made.figures)
    assert {"residual-angle", "residual-direction", "residual-speed"} <= set(made.figures)
    for name, figure in made.figures.items():
        assert len(figure["alt"]) > 30, name
        assert figure["charts"], name
        for chart in figure["charts"]:
            assert strokes(chart), name


def test_signal_that_does_not_vary_has_no_figure(made) -> None:
    assert "residual-temperature" not in made.figures


def test_command_writes_the_page(runs, tmp_path, capsys) -> None:
    rows = ["run,reference_deg,indicated_deg"]
    for run in runs[:2]:
        pairs = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        rows += [f"{run.label},{r!r},{i!r}" for r, i in pairs]
    file = tmp_path / "joint.csv"
    file.write_text("\n".join(rows) + "\n")
    page = tmp_path / "report.html"
    assert main(["report", str(file), "-o", str(page), "--orders", "1", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["provenance"]["inputs"][0]["file"].endswith("joint.csv")
    assert len(content["provenance"]["inputs"][0]["sha256"]) == 64
    assert content["provenance"]["inputs"][0]["sha256"] in page.read_text()


def test_shafts_are_declared_and_named(tmp_path, capsys) -> None:
    theta = np.sort(np.random.default_rng(5).uniform(0.0, 360.0, 400))
    rows = ["run,reference_deg,indicated_deg"]
    for run in range(3):
        error = 0.01 * np.sin(np.radians(50.0 * theta + 20.0))
        rows += [f"{run},{a!r},{b!r}" for a, b in zip(theta.tolist(), (theta + error).tolist(),
                                                     strict=True)]  # fmt: skip
    file, page = tmp_path / "joint.csv", tmp_path / "report.html"
    file.write_text("\n".join(rows) + "\n")
    arguments = ["report", str(file), "-o", str(page), "--shaft", "stepper=50", "--json"]
    assert main([*arguments, "--orders", "stepper:1"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["model"]["coefficients"]
    assert (row["line"], row["output_order"]) == ("stepper 1", 50.0)
    with pytest.raises(ArgumentError, match="give either `shafts=` or a simulation"):
        ta.report(ta.read_runs(file), simulation=ta.Simulation(), shafts={"worm": 3.0})


def test_an_order_of_a_worm_is_drawn_from_a_part_of_its_turn() -> None:
    rng = np.random.default_rng(3)
    theta = np.linspace(334.6, 349.9, 800)
    error = -8.0 * (theta - 342.0) + 8.0 * np.sin(np.radians(144.0 * theta))
    error += np.cumsum(rng.normal(0.0, 1.0, 800))
    time = 4.0 * np.arange(800)
    run = ta.CalibrationRun(theta, theta + error / 3600.0, period=360.0, time=time)
    made = ta.report(run, shafts={"worm": 144.0})
    assert any("worm 1" in figure for figure in [json.dumps(made.figures["spectrum"])])
    kept = [row["order"] for row in made.content["selection"]["table"] if row["retained"]]
    assert kept == [144.0]


def test_bad_file_leaves_no_page(tmp_path, capsys) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("reference_deg\n1\n")
    page = tmp_path / "report.html"
    assert main(["report", str(bad), "-o", str(page)]) == 1
    assert "bad.csv" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [bad]


@pytest.mark.parametrize("missing", ["jinja2", "matplotlib.figure"])
def test_missing_extras_are_named(made, monkeypatch, missing: str) -> None:
    from trueangle.plots.pagechart import page_axes
    from trueangle.reports import page

    monkeypatch.setitem(sys.modules, missing, None)
    needed = "reports need matplotlib and jinja2: pip install 'trueangle[report]'"
    with pytest.raises(MissingExtraError, match=f"^{re.escape(needed)}$"):
        page.rendered_report(made.content, made.figures) if missing == "jinja2" else page_axes()


def test_pdf_without_a_browser_says_what_to_do(made, tmp_path) -> None:
    with pytest.raises(ArgumentError, match="needs an installed browser"):
        made.save_pdf(tmp_path / "report.pdf", browser="no-such-browser")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(find_browser() is None, reason="no browser installed")
def test_pdf_is_printed(made, tmp_path) -> None:
    print_pdf(made.html, tmp_path / "report.pdf")
    data = (tmp_path / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    # Vector figures make the file: a page whose figures failed is much smaller.
    assert len(data) > 200_000
    assert [p.name for p in tmp_path.iterdir()] == ["report.pdf"]


@pytest.fixture(scope="module")
def demo(runs):
    from trueangle.reports.demo import demo_simulation

    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    return ta.report(runs, orders=ORDERS, simulation=demo_simulation())


def test_diagnosis_is_on_the_page(demo, runs) -> None:
    from trueangle.reports.demo import demo_simulation

    result = ta.diagnose(runs, demo_simulation())
    content = demo.content["diagnosis"]
    assert content["simulation"]["rms_arcsec"] == pytest.approx(result.discrepancy.rms, rel=TINY)
    finding = content["findings"][0]
    assert finding["cause"] == "backlash"
    quantity = finding["parameters"][0]
    assert (quantity["name"], quantity["unit"]) == ("half width", "arcsec")
    value = result.findings[0].parameters["half_width_arcsec"].value
    assert quantity["value"] == pytest.approx(value, rel=TINY)
    assert finding["sentence"] in html.unescape(demo.html)
    assert "measured-simulated" in demo.figures


def test_numbers_of_the_diagnosis_are_the_content(demo) -> None:
    numbers = page_numbers(demo.html)
    assert any(path.startswith("diagnosis.findings.0.gain") for path, *_ in numbers)
    for path, per, digits, text in numbers:
        assert text == written(demo.content, path, per, digits), path


def test_extended_simulation_can_be_read_back(demo, tmp_path) -> None:
    file = tmp_path / "extended.toml"
    file.write_text(demo.content["diagnosis"]["extended"])
    extended = ta.load_simulation(file)
    assert [effect.kind for effect in extended.effects] == ["backlash"]


def test_not_identifiable_causes_are_unknowns(demo) -> None:
    entries = {e["what"]: e for e in demo.content["unknowns"]}
    spots = demo.content["diagnosis"]["not_identifiable"]
    assert len(spots) > 0
    for spot in spots:
        what = " or ".join(title_of(cause).replace("_", " ") for cause in spot["causes"])
        assert any(key.startswith(what) for key in entries)


def test_runs_that_support_no_order_get_a_report_that_says_so() -> None:
    rng = np.random.default_rng(5)
    theta = np.arange(0.0, 360.0, 5.0)
    runs = [ta.CalibrationRun(theta, theta + rng.normal(0, 0.01, 72), 360.0) for _ in range(3)]
    made = ta.report(runs)
    assert made.content["model"] is None
    assert made.content["why_no_model"]
    assert "No correction.</strong> No order" in made.html
    assert "and the model" not in made.html
    assert "spectrum" in made.figures


def test_demo_report_is_written(tmp_path) -> None:
    from trueangle.reports import demo_report
    from trueangle.simulation import Latency

    pytest.importorskip("jinja2")
    made = demo_report(tmp_path / "demo.html", hidden=Latency(1e-4), seed=1)
    assert made.content["diagnosis"]["findings"][0]["cause"] == "latency"
    assert 2e5 < (tmp_path / "demo.html").stat().st_size < 7e5


def test_extended_model_takes_off_what_the_harmonics_cannot(demo) -> None:
    extended = demo.content["extended"]
    assert [term["kind"] for term in extended["terms"]] == ["backlash"]
    value = extended["terms"][0]["parameters"][0]["value"]
    assert value * 3600.0 == pytest.approx(8.0, abs=0.3)
    # The noise of 3 arcsec is all that is left.
    assert extended["gain"]["after"]["rms_arcsec"] == pytest.approx(3.0, abs=0.2)
    assert demo.content["gain"]["after"]["rms_arcsec"] > 8.0


def test_boxes_of_runs_mean_the_same_run_in_every_figure(made, runs) -> None:
    compared = set()
    for name, figure in made.figures.items():
        for chart in figure["charts"]:
            for drawn in strokes(chart):
                if name.startswith("residual") or name in ("errors", "before-after"):
                    # Dots of a run are readings of it; lines are of all.
                    of_all = drawn.kind != "dots" or drawn.style["stroke"] == "var(--model)"
                    assert of_all == (drawn.run is None)
                if name == "phases":
                    assert drawn.title.startswith(f"run {runs[drawn.run].label}: ")
                    compared.add(drawn.run)
                if name == "residual-speed":
                    if drawn.run is None:
                        continue
                    speed = runs[drawn.run].speed * (360.0 / runs[drawn.run].period)
                    near = np.abs(drawn.points[:, :1] - speed).min(axis=1)
                    assert near.max() < 1e-3 * np.ptp(chart["x"]["limits"])
    assert compared == set(range(len(runs)))


def test_one_cause_needs_no_chart_of_one_bar(demo) -> None:
    assert len(demo.content["diagnosis"]["findings"]) == 1
    assert not {"error-left", "gains"} & set(demo.figures)


def test_causes_and_gains_are_drawn_where_there_are_several(runs) -> None:
    from dataclasses import replace

    from trueangle.reports.demo import demo_simulation
    from trueangle.simulation import Backlash, Latency

    hidden = replace(demo_simulation(), effects=(Backlash(8.0), Latency(4e-4)))
    made = ta.report(ta.simulate(hidden, seed=4), orders=ORDERS, simulation=demo_simulation())
    assert len(made.content["diagnosis"]["findings"]) > 1
    assert "error-left" in made.figures


def test_gear_orders_are_drawn_as_envelope_and_stretch(made, runs) -> None:
    charts = made.figures["errors"]["charts"]
    assert len(charts) == 2
    assert any(entry["label"] == "envelope of the model" for entry in charts[0]["legend"])
    assert "periods of order" in charts[1]["title"]
    plain = ta.report(runs, orders=[1, 2]).figures["errors"]["charts"]
    assert len(plain) == 1


def test_orders_are_drawn_on_one_axis_with_names_and_sizes(made) -> None:
    (chart,) = made.figures["spectrum"]["charts"]
    assert chart["y"]["scale"] == "log"
    rows = made.content["model"]["coefficients"]
    assert {name["text"] for name in chart["names"]} == {
        row["line"].removeprefix("output ") for row in rows
    }
    dots = [drawn for drawn in strokes(chart) if drawn.title]
    sizes = sorted(float(drawn.points[0, 1]) for drawn in dots)
    wanted = sorted(row["amplitude_arcsec"] for row in rows)
    np.testing.assert_allclose(sizes, wanted, rtol=1e-3)
    told = " ".join(drawn.title for drawn in dots)
    assert all(f"order {row['output_order']:g}: " in told for row in rows)
