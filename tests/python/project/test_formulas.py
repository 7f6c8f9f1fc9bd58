"""Formulas of the documentation in Chromium: outlines that need no font of the system."""

from __future__ import annotations

import sys

import pytest

from conftest import ROOT
from trueangle.reports.page import find_browser

pytest.importorskip("ziamath")
pytest.importorskip("docutils")
playwright = pytest.importorskip("playwright.sync_api")
BROWSER = find_browser()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium installed: .ci/browser")

sys.path.insert(0, str(ROOT / "docs"))

#: Bottom and height of every glyph of a formula, from the left.
GLYPHS = """() => [...document.querySelectorAll("svg path")]
  .map((e) => e.getBoundingClientRect()).filter((r) => r.width > 0.5)
  .sort((a, b) => a.left - b.left).map((r) => [r.bottom, r.height])"""


def page_of(body: str):
    """Boxes of the glyphs that a page with this body shows."""
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 390, "height": 600})
        # A font that no system has: text would fall back, outlines cannot.
        page.set_content(f"<body style='font-family: none-such'>{body}</body>")
        glyphs, texts = page.evaluate(GLYPHS), page.evaluate("document.body.innerText.trim()")
        browser.close()
    return glyphs, texts


@pytest.mark.parametrize("block", [False, True])
@pytest.mark.parametrize(("tex", "sign"), [("C_1", 1), ("x^2", -1)])
def test_subscripts_stand_below_the_line_and_powers_above(tex: str, sign: int, block: bool) -> None:
    import formulas

    glyphs, texts = page_of(formulas.drawn(tex, block))
    assert texts == ""  # nothing is left to a font
    (base, height), (script, small) = glyphs
    assert small < height
    # Some part of the letter's height: what is merely set smaller stands on the line.
    assert sign * (script - base) > 0.1 * height


def test_the_line_of_a_formula_is_that_of_the_text() -> None:
    import formulas

    glyphs, _ = page_of(f"<p>{formulas.drawn('C', False)}{formulas.drawn('C_1', False)}</p>")
    first, second = glyphs[0], glyphs[1]
    assert first[0] == pytest.approx(second[0], abs=0.6)
