"""The page as its readers have it: found at once, printed at once, still without scripts."""

import re
import zlib

import pytest

import trueangle as ta
from trueangle.reports.page import find_browser

playwright = pytest.importorskip("playwright.sync_api")
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
def browser():
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield started
        started.close()


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
