"""What the style and the script of the documentation do to a page on a phone."""

from __future__ import annotations

import pytest

from conftest import ROOT
from trueangle.reports.page import find_browser

playwright = pytest.importorskip("playwright.sync_api")
BROWSER = find_browser()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium installed: .ci/browser")

STATIC = ROOT / "docs" / "static"
#: What Furo puts around a table, a block of code and a picture.
BODY = """<article><div class="table-wrapper docutils container" style="overflow-x:auto">
<table class="docutils"><tr>{cells}</tr></table></div>
<div class="highlight"><pre style="overflow:auto">{code}</pre></div>
<figure><img class="picture" src="data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg'
 width='700' height='300'/%3E"><figcaption>A caption of one sentence.</figcaption></figure>
<img class="wide"><img class="narrow"></article><a class="skip-to-content">Skip</a>"""
HINT = """(selector) => getComputedStyle(document.querySelector(selector), "::before").content"""


def opened(driver, width: int, long: bool):
    """A page of that width with a table, code and a picture."""
    browser = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
    page = browser.new_page(viewport={"width": width, "height": 800})
    cells = "<td>unbreakable</td>" * (12 if long else 2)
    page.set_content(BODY.format(cells=cells, code="x" * (120 if long else 10)))
    page.add_style_tag(path=STATIC / "pages.css")
    page.add_script_tag(path=STATIC / "pages.js")
    page.evaluate("dispatchEvent(new Event('resize'))")
    return browser, page


@pytest.mark.parametrize("long", [True, False])
def test_what_is_wider_than_a_phone_says_that_it_scrolls(long: bool) -> None:
    with playwright.sync_playwright() as driver:
        browser, page = opened(driver, 390, long)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        assert ("swipe" in page.evaluate(HINT, ".table-wrapper")) == long
        shaded = page.evaluate("getComputedStyle(document.querySelector('pre')).backgroundImage")
        assert ("gradient" in shaded) == long
        # A picture keeps the size of its letters, and says that it scrolls.
        assert "swipe" in page.evaluate(HINT, "figure")
        assert page.evaluate("document.querySelector('figure img').offsetWidth") >= 500
        caption = page.evaluate(
            "document.querySelector('figcaption').getBoundingClientRect().right"
        )
        assert caption <= 390
        browser.close()


@pytest.mark.parametrize(("width", "seen"), [(390, "narrow"), (1280, "wide")])
def test_one_of_two_forms_of_a_picture_is_seen(width: int, seen: str) -> None:
    with playwright.sync_playwright() as driver:
        browser, page = opened(driver, width, False)
        shown = page.evaluate(
            """[...document.querySelectorAll("article > img")]
               .filter((e) => getComputedStyle(e).display !== "none").map((e) => e.className)"""
        )
        assert shown == [seen]
        browser.close()


def test_paper_has_the_wide_form_and_nothing_floating() -> None:
    """Sheets are narrow, and what is fixed on a screen would cover words on each of them."""
    with playwright.sync_playwright() as driver:
        browser, page = opened(driver, 700, True)
        page.emulate_media(media="print")
        seen = page.evaluate(
            """[...document.querySelectorAll("img.wide, img.narrow, .skip-to-content")]
               .filter((e) => getComputedStyle(e).display !== "none").map((e) => e.className)"""
        )
        assert seen == ["wide"]
        for what in (".table-wrapper", "figure"):
            hint = f"getComputedStyle(document.querySelector('{what}'), '::before').display"
            assert page.evaluate(hint) == "none"
        browser.close()
