"""The page in a real browser: Chromium of the distribution, driven by Playwright."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from trueangle.reports.page import find_browser
from trueangle.reports.wording import formatted_number, lookup

from .scripts import (
    CARDS_BURST,
    CONTRASTS,
    OUT_OF_REACH,
    TEXTS_AROUND,
    TEXTS_WITHIN,
    VIEW,
    VISIBLE_POINTS,
)

pytest.importorskip("playwright.sync_api")
BROWSER = find_browser()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium installed: .ci/browser")

#: Least contrast of a point or line with the page (WCAG 1.4.11).
CONTRAST = 3.0
#: Largest report, in bytes.
LARGEST = 500_000
#: Processor time in seconds until the page can be used, and trials of which the best counts.
SOON, TRIALS = 0.5, 3
#: Two threads that share a core take up to twice the time for each: so where all are in use.
SHARED = 2.0

#: The narrowest phones, in pixels.
NARROW = 300

WIDTHS = {"desktop": 1200, "phone": 390}


@pytest.fixture(scope="module")
def file(made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    made.save(path)
    return path


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
        self.page.wait_for_selector("html[data-ready]", timeout=60_000)
        # Unfolded, so that all of it is looked at.
        self.page.evaluate(
            "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
        )

    def visible_points(self, figure: str) -> int:
        """Points of the figure's dots that are shown."""
        return self.page.evaluate(VISIBLE_POINTS, f"figure-{figure}")


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
        """[...document.querySelectorAll("main p, main li, h1, h2, .card, .plot .axes")]
           .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
           .map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert outside == []


def test_figures_are_drawn(page: Page) -> None:
    boxes = page.page.locator(".plot:not([hidden]) .box")
    assert boxes.count() >= 5
    for i in range(boxes.count()):
        box = boxes.nth(i).bounding_box()
        assert box["width"] > 60
        assert box["height"] > 60
        assert boxes.nth(i).locator("path:not(.grid)").count() > 0


def test_report_is_small_and_soon_there(browser, file: Path) -> None:
    assert file.stat().st_size < LARGEST
    processes = browser.new_browser_cdp_session()

    def spent() -> dict[int, float]:
        found = processes.send("SystemInfo.getProcessInfo")["processInfo"]
        return {p["id"]: p["cpuTime"] for p in found if p["type"] == "renderer"}

    used = []
    for _ in range(TRIALS):
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.goto("about:blank")
        before = spent()
        page.goto(file.as_uri())
        page.wait_for_selector("html[data-ready]", timeout=60_000)
        # Of the page's own process; the browser keeps others in reserve.
        used.append(max(now - before.get(which, 0.0) for which, now in spent().items()))
        page.close()
    print(f"processor time until interactive: {sorted(used)} s")
    # The least of some trials: what others do on the machine only adds to it.
    busy = os.getloadavg()[0] > 0.5 * (os.cpu_count() or 1)
    assert min(used) < SOON * (SHARED if busy else 1.0)


def test_texts_within_charts_do_not_overlap(browser, file: Path) -> None:
    """Ticks, names of axes and of lines."""
    page = browser.new_page(viewport={"width": 1200, "height": 900})
    page.goto(file.as_uri() + "#print")
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    found = page.evaluate(TEXTS_WITHIN)
    page.close()
    assert found[0] > 50
    assert found[1] == []


def test_texts_of_a_chart_do_not_overlap(page: Page) -> None:
    """Titles, legends and captions of figures."""
    clashes = page.page.evaluate(TEXTS_AROUND)
    assert clashes == []


def test_what_is_wider_than_the_page_can_be_reached(browser, file: Path) -> None:
    opened = Page(browser, file, WIDTHS["phone"])
    opened.page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    opened.page.evaluate("dispatchEvent(new Event('resize'))")
    lost = opened.page.evaluate(OUT_OF_REACH)
    opened.page.close()
    assert lost == []


def test_a_page_of_degrees_keeps_its_texts_apart(browser, large, tmp_path: Path) -> None:
    """One run, several causes of one kind, a part of a turn: other figures than the page above."""
    path = tmp_path / "large.html"
    large.save(path)
    assert path.stat().st_size < LARGEST
    paper = browser.new_page(viewport={"width": 1200, "height": 900})
    paper.goto(path.as_uri() + "#print")
    paper.wait_for_selector("html[data-ready]", timeout=60_000)
    texts, clashes = paper.evaluate(TEXTS_WITHIN)
    paper.close()
    assert texts > 50
    assert clashes == []
    for scheme, width in (("light", WIDTHS["phone"]), ("dark", NARROW)):
        phone = Page(browser, path, width, scheme)
        assert phone.complaints == []
        assert phone.page.evaluate(TEXTS_AROUND) == []
        assert phone.page.evaluate(OUT_OF_REACH) == []
        phone.page.evaluate("dispatchEvent(new Event('resize'))")
        texts, clashes = phone.page.evaluate(TEXTS_WITHIN)
        assert texts > 50
        assert clashes == []
        assert min(phone.page.evaluate(CONTRASTS).values()) >= CONTRAST
        phone.page.close()


def test_wide_tables_say_that_they_scroll(page: Page) -> None:
    silent = page.page.evaluate(
        """[...document.querySelectorAll(".scroll")].filter((e) => e.offsetParent
             && e.scrollWidth > e.clientWidth + 1
             && getComputedStyle(e.querySelector(".hint")).display === "none"
             && innerWidth < 640).map((e) => e.getAttribute("aria-label"))"""
    )
    assert silent == []


@pytest.mark.parametrize("width", [NARROW, 390, 700, 1280])
def test_numbers_stay_inside_their_cards(browser, file: Path, width: int) -> None:
    opened = Page(browser, file, width)
    assert opened.page.evaluate(CARDS_BURST) == []
    opened.page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_points_are_seen_in_both_themes(browser, file: Path, scheme: str) -> None:
    opened = Page(browser, file, 1200, scheme)
    ratios = opened.page.evaluate(CONTRASTS)
    assert len(ratios) >= 5
    assert min(ratios.values()) >= CONTRAST, ratios
    opened.page.close()


def test_tables_equal_the_json(page: Page, made) -> None:
    result = json.loads(page.page.locator("#result").text_content())
    assert result == made.content
    shown = page.page.evaluate(
        """[...document.querySelectorAll("[data-path]")]
           .map((e) => [e.dataset, e.textContent]).map(([data, text]) =>
             [data.path, Number(data.per || 1), (text.split(".")[1] || "").length, text])"""
    )
    assert len(shown) > 150
    for path, per, digits, text in shown:
        value = lookup(result, path)
        assert text == formatted_number(None if value is None else value * per, digits), path


def test_box_of_a_run_hides_it_in_every_figure(page: Page) -> None:
    page.page.locator("#signal").select_option("figure-residual-angle")
    before = page.visible_points("errors"), page.visible_points("residual-angle")
    page.page.locator(".run-toggle").first.uncheck()
    page.page.wait_for_function(
        f"n => ({VISIBLE_POINTS})('figure-residual-angle') < n", arg=before[1]
    )
    after = page.visible_points("errors"), page.visible_points("residual-angle")
    assert after[0] == pytest.approx(before[0] * 7 / 8, rel=0.01)
    assert after[1] == pytest.approx(before[1] * 7 / 8, rel=0.01)
    page.page.locator(".run-toggle").first.check()
    page.page.wait_for_function(
        f"n => ({VISIBLE_POINTS})('figure-residual-angle') === n", arg=before[1]
    )


def test_hover_names_order_and_amplitude(page: Page, made) -> None:
    """By the title of the dot."""
    titles = page.page.evaluate(
        "[...document.querySelectorAll('#figure-spectrum title')].map((e) => e.textContent)"
    )
    amplitude = made.content["model"]["coefficients"][0]["amplitude_arcsec"]
    (first,) = [text for text in titles if text.startswith("order 1: ")]
    assert float(first.split()[2]) == pytest.approx(amplitude, rel=1e-3)


def test_residual_can_be_drawn_against_another_signal(page: Page) -> None:
    page.page.locator("#signal").select_option("figure-residual-direction")
    shown = page.page.locator("#figure-residual-direction")
    assert shown.is_visible()
    assert not page.page.locator("#figure-residual-angle").is_visible()
    assert "direction of travel" in shown.inner_text()
    assert "direction" in shown.get_attribute("aria-label")


def numbers(page: Page) -> list[float]:
    """At the upright axis of the first figure, where they are shown."""
    texts = page.page.evaluate(
        """[...document.querySelector("#figure-errors .x").children]
           .filter((e) => e.checkVisibility()).map((e) => e.textContent)"""
    )
    return [float(text.replace("\N{MINUS SIGN}", "-")) for text in texts]


def test_keys_zoom_and_reset(page: Page) -> None:
    page.page.locator("#figure-errors").focus()
    page.page.keyboard.press("+")
    assert page.page.evaluate(VIEW, "figure-errors") == pytest.approx([1500, 0, 7000, 10_000])
    assert all(54.0 <= n <= 306.0 for n in numbers(page))
    assert len(numbers(page)) >= 3
    page.page.keyboard.press("ArrowRight")
    assert page.page.evaluate(VIEW, "figure-errors")[0] == pytest.approx(2200)
    page.page.keyboard.press("0")
    assert page.page.evaluate(VIEW, "figure-errors") == [0, 0, 10_000, 10_000]
    assert (numbers(page)[0], numbers(page)[-1]) == (0.0, 360.0)


def test_a_drag_zooms_and_a_double_click_shows_all(page: Page) -> None:
    box = page.page.locator("#figure-errors .box").first
    box.scroll_into_view_if_needed()
    at = box.bounding_box()
    mouse = page.page.mouse
    mouse.move(at["x"] + 0.25 * at["width"], at["y"] + 0.2 * at["height"])
    mouse.down()
    mouse.move(at["x"] + 0.5 * at["width"], at["y"] + 0.7 * at["height"])
    mouse.up()
    view = page.page.evaluate(VIEW, "figure-errors")
    assert view == pytest.approx([2500, 2000, 2500, 5000], abs=80)
    assert all(85.0 <= n <= 185.0 for n in numbers(page))
    box.dblclick()
    assert page.page.evaluate(VIEW, "figure-errors") == [0, 0, 10_000, 10_000]


def test_page_can_be_walked_by_tab(page: Page) -> None:
    reached = set()
    for _ in range(90):
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
    # Notes are smaller than the text that they stand below, as on a screen.
    text, *notes = page.page.evaluate(
        """["#measured ~ p", ".note", ".words dd", ".card > span:not(.big)"].map((s) =>
             parseFloat(getComputedStyle(document.querySelector(s)).fontSize))"""
    )
    assert max(notes) <= text
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
