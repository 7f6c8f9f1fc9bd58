"""Every block of the documentation runs and shows what it says."""

import re
import shlex
import sys

import pytest

from conftest import ROOT
from markdown_blocks import run_page
from trueangle.cli import COMMANDS, build_parser
from trueangle.effects import KINDS

PAGES = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [page for page in PAGES if "_build" not in page.parts and "_generated" not in page.parts]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_runs(page, tmp_path):
    if page.stem == "report" or page.stem == "tutorial":
        pytest.importorskip("matplotlib")
        pytest.importorskip("jinja2")
    effects = dict(KINDS)
    run_page(page, tmp_path)
    assert effects == KINDS  # what a page defines would be met by the tests after it


HOWTO = [page for page in PAGES if page.parent.name == "howto"]


@pytest.mark.parametrize("page", HOWTO, ids=lambda page: page.stem)
def test_a_how_to_begins_with_what_one_has_and_ends_with_what_one_got(page):
    parts = page.read_text(encoding="utf-8").strip().split("\n\n")
    assert parts[0].startswith("# ")
    assert parts[1].startswith("*You have* ")
    assert parts[-1].startswith("*You got* ")
    # And it is found.
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert f"\nhowto/{page.stem}\n" in index


def test_every_question_has_a_command_that_there_is_and_a_page():
    page = ROOT / "docs" / "howto" / "which-command.md"
    rows = re.findall(r"^\| (.+\?) \| (.+) \| \[.*\]\((.+)\) \|$", page.read_text("utf-8"), re.M)
    named = set()
    for question, cell, link in rows:
        assert (page.parent / link).is_file(), question
        for command in re.findall(r"`trueangle (.+?)`", cell):
            # Options and their arguments are those that the command has.
            build_parser().parse_args(shlex.split(command))
            named.add(command.split()[0])
    assert named == set(COMMANDS), "a command answers no question"


def test_attributes_that_share_a_line_are_listed_each():
    sys.path.insert(0, str(ROOT / "docs"))
    from docstrings import one_attribute_each

    lines = ["Attributes", "----------", "a, b,", "c : int", "    Three.", "d : str", ""]
    lines += ["Examples", "--------", ">>> x, y"]
    assert one_attribute_each(lines) == [
        *("Attributes", "----------", "a : int", "    Three.", "b : int", "    Three."),
        *("c : int", "    Three.", "d : str", "", "Examples", "--------", ">>> x, y"),
    ]
