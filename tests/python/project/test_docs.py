"""Every block of the documentation runs and shows what it says."""

import sys

import pytest

from conftest import ROOT
from markdown_blocks import run_page

PAGES = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [page for page in PAGES if "_build" not in page.parts and "_generated" not in page.parts]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_runs(page, tmp_path):
    if page.stem == "report" or page.stem == "tutorial":
        pytest.importorskip("bokeh")
        pytest.importorskip("jinja2")
    run_page(page, tmp_path)


def test_there_are_pages():
    assert len(PAGES) >= 10


def test_attributes_that_share_a_line_are_listed_each():
    sys.path.insert(0, str(ROOT / "docs"))
    from docstrings import one_attribute_each

    lines = ["Attributes", "----------", "a, b,", "c : int", "    Three.", "d : str", ""]
    lines += ["Examples", "--------", ">>> x, y"]
    assert one_attribute_each(lines) == [
        *("Attributes", "----------", "a : int", "    Three.", "b : int", "    Three."),
        *("c : int", "    Three.", "d : str", "", "Examples", "--------", ">>> x, y"),
    ]
