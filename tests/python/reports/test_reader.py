"""The page as its readers have it: found at once, printed at once, still without scripts."""

import html
import re
import zlib

import numpy as np
import pytest

import trueangle as ta
from plots.strokes import strokes
from trueangle.plots.curves import Points, thinned_points, travelled_degrees
from trueangle.plots.readingpictures import ANGLE, Cloud, Panel, PanelPicture
from trueangle.reports.diagnosed import _parameter
from trueangle.reports.figures import panel_figure
from trueangle.reports.page import find_browser

pytest.importorskip("playwright.sync_api")
pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")
BROWSER = find_browser()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium installed: .ci/browser")

#: Height of the page of a measured joint with a diagnosis, in pixels at this width, and its bytes.
WIDTH, HIGHEST, LARGEST = 1280, 6000, 600_000

#: Questions on a joint, and what answers each; those of a section after one click on its link.
QUESTIONS = {
    "how bad": ("", "peak-to-peak: the error of this joint"),
    "what is left": ("", "rms before and after correction"),
    "why": ("", "confirmed:"),
    "is it certain": ("", "95 % interval"),
    "which runs are odd": ("measured", "peak-to-peak"),
    "what may not be corrected": ("simulation", "not correctable"),
    "what to do next": ("unknown", "measure"),
    "what is not known": ("unknown", "because"),
    "valid where": ("model", "It holds from"),
    "made from what": ("provenance", "sha256"),
}


@pytest.fixture(scope="module")
def measured(data_dir, tmp_path_factory):
    """A measured joint against a simulation that knows nothing of it."""
    folder = tmp_path_factory.mktemp("measured")
    empty = ta.Simulation(sigma_arcsec=250.0)
    file = folder / "report.html"
    return file, ta.report(data_dir / "rm44_repeat.csv", file, simulation=empty)


def opened(browser, file, width, **more):
    page = browser.new_page(viewport={"width": width, "height": 900}, **more)
    page.goto(file.as_uri())
    return page


def test_a_measured_joint_takes_five_screens(browser, measured):
    file, made = measured
    page = opened(browser, file, WIDTH)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    assert page.evaluate("document.documentElement.scrollHeight") <= HIGHEST
    assert file.stat().st_size < LARGEST
    assert "measured-simulated" not in made.figures  # it would be the measured error once more
    page.close()


def test_nothing_is_cut_on_a_phone(browser, measured):
    page = opened(browser, measured[0], 390)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    cut = page.evaluate(
        """[...document.querySelectorAll(".causes th, .causes td")]
           .filter((e) => e.checkVisibility())
           .filter((e) => e.getBoundingClientRect().right > innerWidth).length"""
    )
    assert cut == 0
    page.close()


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_is_answered_in_the_first_screen_or_by_one_click(question, browser, measured):
    section, words = QUESTIONS[question]
    page = opened(browser, measured[0], WIDTH)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    if section:
        page.locator(f"nav a[href='#{section}']").click()
        # The scroll to it is smooth.
        page.wait_for_function(
            f"() => document.getElementById('{section}').getBoundingClientRect().top"
            " < innerHeight / 2 || innerHeight + scrollY + 2 >= document.body.scrollHeight"
        )
    seen = page.evaluate(
        """(words) => [...document.querySelectorAll("main *")].some((e) => {
             const box = e.getBoundingClientRect();
             return e.checkVisibility() && [...e.childNodes].some((t) => t.nodeType === 3
               && t.textContent.includes(words)) && box.height && box.top < innerHeight
               && box.bottom > 0; })""",
        words,
    )
    assert seen, question
    page.close()


def test_a_page_printed_at_load_holds_every_figure(browser, measured):
    """Its figures are vectors that are there from the start."""
    file, made = measured
    page = browser.new_page(viewport={"width": WIDTH, "height": 900}, color_scheme="dark")
    page.goto(file.as_uri(), wait_until="load")
    at_load = page.pdf()
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    later = page.pdf()
    page.close()
    lines = [painted(data) for data in (at_load, later)]
    charts = sum(len(f["charts"]) for name, f in made.figures.items() if "residual" not in name) + 1
    # A chart has some hundred dots, and a grid.
    assert lines[0] > 20 * charts
    assert lines[0] == pytest.approx(lines[1], rel=0.02)


def painted(pdf):
    """Strokes of the pages of a PDF."""
    count = 0
    for match in re.finditer(rb"stream\r?\n", pdf):
        raw = pdf[match.end() : pdf.find(b"endstream", match.end())]
        try:
            count += len(re.findall(rb"[\d.]+ [\d.]+ l\b", zlib.decompress(raw)))
        except zlib.error:
            continue
    return count


def test_without_scripts_the_figures_are_there(browser, measured):
    page = opened(browser, measured[0], WIDTH, java_script_enabled=False)
    box = page.locator("#figure-errors .box").bounding_box()
    assert box["width"] > 600
    assert box["height"] > 150
    page.close()


def test_hundreds_of_rows_are_not_printed() -> None:
    """The rows that a run's outliers stand in were once a column taller than the page."""
    rows = [["monday", row] for row in range(400)]
    text = _parameter(0, "rows", {"value": rows, "std": None}, named=False)["text"]
    assert text.splitlines()[:2] == ["monday row 0", "monday row 1"]
    assert text.splitlines()[-1] == "and 394 more"
    few = _parameter(0, "rows", {"value": rows[:3], "std": None}, named=False)["text"]
    assert few.splitlines() == ["monday row 0", "monday row 1", "monday row 2"]


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [(-93.0, 100.0, (-93.0, 100.0)), (20.0, 200.0, (20.0, 200.0)), (0.0, 350.0, (0.0, 360.0)),
     (170.0, 350.0, (170.0, 350.0)), (300.0, 420.0, (-60.0, 60.0)), (200.0, 440.0, (-160.0, 80.0)),
     (100.0, 359.0, (100.0, 359.0))],
)  # fmt: skip
def test_a_travel_without_a_model_is_drawn_in_one_piece(low, high, shown) -> None:
    theta = np.linspace(low, high, 200)
    rng = np.random.default_rng(20261122)
    error = rng.normal(0.0, 0.01, (2, theta.size))
    runs = [ta.CalibrationRun(theta % 360.0, theta % 360.0 + e, 360.0) for e in error]
    assert travelled_degrees(runs) == pytest.approx(shown)
    pytest.importorskip("matplotlib")
    made = ta.report(runs)
    assert made.content["model"] is None
    (chart,) = made.figures["errors"]["charts"]
    assert chart["x"]["limits"] == pytest.approx(shown)


ARCSEC = 1.0 / 3600.0
#: Half of the reversal error of the joint, in arcsec, and the noise of a reading.
HALF, SIGMA = 6.05, 1.0


@pytest.fixture(scope="module")
def at_one_speed(tmp_path_factory):
    """Runs out and back at one speed: backlash and latency are one and the same step."""
    rng = np.random.default_rng(20261122)
    theta = np.concatenate([np.arange(0.0, 360.0, 2.5), np.arange(357.5, -2.5, -2.5)])
    way = np.repeat([1.0, -1.0], theta.size // 2)
    runs = []
    for number in range(4):
        error = HALF * way + rng.normal(0.0, SIGMA, theta.size)
        time = 0.5 * np.arange(theta.size) + np.where(way > 0.0, 0.0, 60.0)
        runs.append(
            ta.CalibrationRun(theta, theta + ARCSEC * error, 360.0, time=time, label=f"{number}")
        )
    path = tmp_path_factory.mktemp("seen") / "joint.toml"
    path.write_text(
        "[joint]\ngear_ratio = 100.0\nencoder_side = 'output'\n[noise]\nsigma_arcsec = 1.0\n"
    )
    return runs, ta.load_simulation(path)


def sizes(text):
    """Sizes of a backlash among the first lines, in arcsec, with their standard errors."""
    return [
        (float(value), float(std))
        for value, std in re.findall(
            r"(?:half width|backlash) \(?([0-9.]+) (?:\+-|±) ([0-9.]+)", text
        )
    ]


def test_it_stands_in_the_first_lines_of_the_summary(at_one_speed):
    found = ta.diagnose(*at_one_speed, gain=False)
    assert not any(finding.confirmed for finding in found.findings)
    first = " ".join(line.strip() for line in found.summary().split("\n\n")[0].splitlines())
    assert "Detected, not distinguished: " in first
    assert "backlash" in first
    assert any(abs(value - HALF) < 5.0 * std < 1.0 for value, std in sizes(first))


def test_it_stands_in_the_first_lines_of_the_report(at_one_speed):
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    runs, simulation = at_one_speed
    page = ta.report(runs, simulation=simulation, orders=[1]).html
    body = page[page.index("<body") :]
    first = body[: body.index('aria-labelledby="measured"')]
    text = " ".join(html.unescape(re.sub(r"<[^>]*>", "", first)).split())
    assert "Detected, not distinguished:" in text
    assert any(abs(value - HALF) < 5.0 * std < 1.0 for value, std in sizes(text))


#: Bytes of a page at most.
MANY_RUNS_LARGEST = 1_000_000


def test_few_runs_are_drawn_whole_and_many_in_part():
    totals = []
    for runs in (1, 12, 24, 48, 79):
        angle = np.linspace(0.0, 360.0, 2990 // min(runs, 12))
        clouds = tuple(Cloud(Points(f"{k}", angle, angle), k) for k in range(runs))
        picture = PanelPicture((Panel(ANGLE, "error / deg", clouds, (0.0, 360.0)),), "")
        (chart,) = panel_figure(picture)["charts"]
        drawn = strokes(chart)
        assert {one.run for one in drawn} == set(range(runs))
        totals.append(sum(len(one.points) for one in drawn))
    assert totals[:2] == [2990, 12 * 249]
    assert totals[1:] == sorted(totals[1:], reverse=True)
    assert totals[-1] > 400


def test_runs_that_are_alike_are_not_drawn_at_the_same_places():
    angle = np.arange(0.0, 360.0, 0.36)
    places = [thinned_points(Points("", angle, angle), 6, number).x for number in range(79)]
    assert all(5 <= x.size <= 6 for x in places)
    drawn = np.sort(np.concatenate(places))
    # Evenly spread: no gap as wide as a hundredth of a turn.
    assert np.diff(np.concatenate([drawn, [drawn[0] + 360.0]])).max() < 3.6


def test_a_page_of_eighty_runs_is_small(tmp_path):
    seed = 79
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    angle = np.arange(0.0, 360.0, 0.9)
    runs = []
    for k in range(80):
        phase = np.radians(angle + rng.uniform(0.0, 0.5))
        error = 0.4 * np.sin(phase) + 0.1 * np.cos(4.0 * phase) + rng.normal(0.0, 0.06, 400)
        time = angle / 300.0 + 1e-4 * rng.random(400)
        runs.append(ta.CalibrationRun(angle, angle + error, 360.0, time, label=f"run {k}"))
    ta.report(runs, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < MANY_RUNS_LARGEST
