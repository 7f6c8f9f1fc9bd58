"""Every block of the documentation runs and shows what it says."""

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
