"""The table of rooms and the architecture page say where things are, and they are there."""

import ast
import re
import sys
import tomllib

from conftest import ROOT

sys.path.insert(0, str(ROOT / "docs"))

from roomfiles import first_sentence, room_files_page, rooms_of, syntax

PACKAGE = ROOT / "python" / "trueangle"
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")


def rooms_of_the_table():
    return rooms_of(CONTRIBUTING)


def test_the_table_has_every_room_in_the_order_of_the_floors():
    floors = tomllib.loads((ROOT / ".ci" / "arrows.toml").read_text("utf-8"))["floors"]
    assert rooms_of_the_table() == [room for room in floors if not room.startswith("_")]
    there = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    there |= {path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith("_")}
    assert set(rooms_of_the_table()) == there


def test_what_the_page_names_is_there():
    named = set(re.findall(r"`([\w/]+(?:/|\.py|\.rs))`", PAGE))
    assert [p for p in named if not ((PACKAGE / p).exists() or (ROOT / p).exists())] == []


def test_tests_mirror_rooms():
    """A folder of tests is a room's, or one of those that belong to none."""
    apart = {"core", "hidden", "injection", "project", "transcripts"}
    folders = {path.parent.name for path in (ROOT / "tests" / "python").glob("*/__init__.py")}
    assert folders - apart <= set(rooms_of_the_table())
    assert not [path.name for path in (ROOT / "tests" / "python").glob("test_*.py")]


def test_what_is_slow_is_there():
    here = ROOT / "tests" / "python"
    lines = (here / "slow.txt").read_text("utf-8").splitlines()
    named = [line for line in lines if line and not line.startswith("#")]
    assert [name for name in named if not (here / name).exists()] == []
    assert len(named) == len(set(named))


def test_the_page_lists_every_file_by_its_first_sentence_and_its_names():
    page = room_files_page()
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("| `")]
    listed = {file.strip(" `"): (held.strip(), names) for file, held, names in rows}
    files = [file for file in PACKAGE.rglob("*.py") if file.name != "__init__.py"]
    for file in files:
        tree = syntax(file)
        assert ast.get_docstring(tree), file
        if file.parent != PACKAGE:
            held, names = listed.pop(str(file.relative_to(PACKAGE)))
            assert held == first_sentence(file)
            for node in tree.body:
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    assert (f"`{node.name}`" in names) != node.name.startswith("_"), file
    assert not listed
