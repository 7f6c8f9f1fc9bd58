"""The page in a real browser: Chromium of the distribution, driven by Playwright."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from trueangle.reports.page import formatted, lookup
from trueangle.reports.pdf import find_browser

playwright = pytest.importorskip("playwright.sync_api")
BROWSER = find_browser()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium installed: .ci/browser")

WIDTHS = {"desktop": 1200, "phone": 390}


@pytest.fixture(scope="module")
def file(made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    made.save(path)
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield started
        started.close()


class Page:
    """An open report with everything that went wrong on it."""

    def __init__(self, browser, file: Path, width: int, scheme: str = "light") -> None:
        self.page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(f"{m.type}: {m.text}"))
        self.page.on("pageerror", lambda e: self.complaints.append(str(e)))
        self.page.on("request", lambda r: self.requests.append(r.url))
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("html[data-ready]", timeout=30_000)

    def visible_points(self, figure: str) -> int:
        return self.page.locator(f"#figure-{figure} .scatterlayer .point").count()


@pytest.fixture(scope="module", params=sorted(WIDTHS))
def page(request: pytest.FixtureRequest, browser, file: Path) -> Iterator[Page]:
    opened = Page(browser, file, WIDTHS[request.param])
    yield opened
    opened.page.close()


def test_page_is_quiet_and_stays_at_home(page: Page, file: Path) -> None:
    assert page.page.evaluate("document.documentElement.dataset.ready") == "true"
    assert page.complaints == []
    local = (file.as_uri(), "data:", "blob:")
    assert [url for url in page.requests if not url.startswith(local)] == []


def test_nothing_sticks_out_of_the_page(page: Page) -> None:
    over = page.page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert over <= 0
    outside = page.page.evaluate(
        """[...document.querySelectorAll("main p, main li, h1, h2, .card, .plot svg")]
           .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
           .map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert outside == []


def test_figures_are_drawn(page: Page) -> None:
    plots = page.page.locator(".plot")
    assert plots.count() >= 5
    for i in range(plots.count()):
        plot = plots.nth(i)
        marks = plot.locator("path.point, .points path, .scatterlayer path, .bars path")
        assert marks.count() > 0, plot.get_attribute("id")
        box = plot.locator("svg.main-svg").first.bounding_box()
        assert box["width"] > 250
        assert box["height"] > 200


def test_tables_equal_the_json(page: Page, made) -> None:
    result = json.loads(page.page.locator("#result").text_content())
    assert result == made.content
    shown = page.page.evaluate(
        """[...document.querySelectorAll("td .n, .card .n, p .n")]
           .map((e) => [e.dataset.path, Number(e.dataset.digits), e.textContent])"""
    )
    assert len(shown) > 150
    for path, digits, text in shown:
        assert text == formatted(lookup(result, path), digits), path


def test_box_of_a_run_hides_it_in_every_figure(page: Page) -> None:
    page.page.locator("#signal").select_option("residual-angle")
    before = page.visible_points("errors"), page.visible_points("residual")
    page.page.locator(".run-toggle").first.uncheck()
    page.page.wait_for_function(
        "n => document.querySelectorAll('#figure-residual .scatterlayer .point').length < n",
        arg=before[1],
    )
    after = page.visible_points("errors"), page.visible_points("residual")
    assert after[0] == pytest.approx(before[0] * 7 / 8, rel=0.01)
    assert after[1] == pytest.approx(before[1] * 7 / 8, rel=0.01)
    page.page.locator(".run-toggle").first.check()
    page.page.wait_for_function(
        "n => document.querySelectorAll('#figure-residual .scatterlayer .point').length === n",
        arg=before[1],
    )


def test_hover_names_order_and_amplitude(page: Page, made) -> None:
    bar = page.page.locator("#figure-spectrum .bars .point").first
    bar.scroll_into_view_if_needed()
    box = bar.bounding_box()
    page.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    label = page.page.locator("#figure-spectrum .hoverlayer .hovertext").first
    label.wait_for(timeout=5000)
    amplitude = made.content["model"]["coefficients"][0]["amplitude_arcsec"]
    # Figures are drawn from numbers rounded to 0.001 arcsec.
    assert label.text_content() == f"order 1: {round(amplitude, 3):.2f} arcsec"


def test_residual_can_be_drawn_against_another_signal(page: Page) -> None:
    page.page.locator("#signal").select_option("residual-direction")
    page.page.wait_for_selector("#figure-residual .boxlayer path")
    assert "direction" in page.page.locator("#figure-residual").get_attribute("aria-label")


def test_keys_zoom_and_reset(page: Page) -> None:
    plot = page.page.locator("#figure-errors")
    plot.focus()
    width = "() => { const a = document.getElementById('figure-errors')._fullLayout.xaxis.range;"
    width += " return a[1] - a[0]; }"
    full = page.page.evaluate(width)
    page.page.keyboard.press("+")
    page.page.wait_for_function(f"({width})() < {0.71 * full}")
    page.page.keyboard.press("0")
    page.page.wait_for_function(f"({width})() >= {full}")


def test_page_can_be_walked_by_tab(page: Page) -> None:
    reached = set()
    for _ in range(60):
        page.page.keyboard.press("Tab")
        reached.add(
            page.page.evaluate("document.activeElement.id || document.activeElement.className")
        )
    assert {"skip", "theme", "figure-errors", "run-toggle", "signal"} <= reached


def test_every_picture_has_a_text_and_every_control_a_name(page: Page) -> None:
    unnamed = page.page.evaluate(
        """[...document.querySelectorAll("[role=img], [role=region], button, select, input")]
           .filter((e) => !e.getAttribute("aria-label"))
           .filter((e) => !(e.labels && e.labels[0] && e.labels[0].textContent.trim()))
           .map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert unnamed == []


def test_paper_hides_controls(page: Page) -> None:
    page.page.emulate_media(media="print")
    assert not page.page.locator("#theme").is_visible()
    assert not page.page.locator(".run-toggle").first.is_visible()
    assert page.page.locator("#figure-errors").is_visible()
    page.page.emulate_media(media="screen")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_contrasts_with_its_background(browser, file: Path, scheme: str) -> None:
    opened = Page(browser, file, 1200, scheme)
    ratio = opened.page.evaluate(
        """() => {
          const light = (c) => { const v = c.match(/\\d+/g).slice(0, 3).map((x) => x / 255)
            .map((x) => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
            return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
          const back = light(getComputedStyle(document.body).backgroundColor);
          return ["body", ".note", ".card span", "figcaption"].map((s) => {
            const text = light(getComputedStyle(document.querySelector(s)).color);
            return (Math.max(text, back) + 0.05) / (Math.min(text, back) + 0.05); });
        }"""
    )
    # WCAG AA for text.
    assert min(ratio) >= 4.5
    back = opened.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert back == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(21, 24, 28)")
    opened.page.locator("#theme").click()
    opened.page.wait_for_function(
        "b => getComputedStyle(document.body).backgroundColor !== b", arg=back
    )
    assert opened.complaints == []
    opened.page.close()
