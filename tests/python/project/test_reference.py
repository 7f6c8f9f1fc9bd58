"""The reference: every name it lists can be imported, and it lists what is public."""

import ast
import importlib
import inspect
import re
import sys
from collections import defaultdict
from pathlib import Path

import pytest

import trueangle
import trueangle as ta
from conftest import ROOT

sys.path.insert(0, str(ROOT / "docs"))
import causes
import interface
import reference_pages

FOLDER = ROOT / "docs" / "reference"
LISTED = list(reference_pages.pages(FOLDER))


def test_there_is_a_page_for_every_room():
    assert len({page for page, _ in LISTED}) >= 15
    assert len(LISTED) >= 90


def test_what_is_listed_can_be_imported_and_is_described():
    found = {name: reference_pages.imported(name) for _, name in LISTED}
    bare = [name for name, what in found.items() if callable(what) and not inspect.getdoc(what)]
    assert not bare


def test_a_name_that_is_gone_is_noticed():
    with pytest.raises(ImportError, match="no_such_thing"):
        reference_pages.imported("trueangle.no_such_thing")


def test_the_pages_list_everything_that_the_package_shows():
    listed = {reference_pages.imported(name) for _, name in LISTED if callable_(name)}
    shown = {name: getattr(ta, name) for name in ta.__all__ if callable(getattr(ta, name))}
    assert [name for name, what in shown.items() if what not in listed] == []


def test_the_page_of_the_interface_has_what_the_code_has():
    page = interface.PAGE.read_text(encoding="utf-8")
    assert interface.written(page) == page, "meant? `python docs/interface.py`, then read it"


def callable_(name):
    return callable(reference_pages.imported(name))


def test_every_page_is_in_the_menu_and_in_the_index():
    menu = (ROOT / "docs" / "index.md").read_text()
    index = (FOLDER / "index.md").read_text()
    for page in FOLDER.glob("*.md"):
        assert f"\nreference/{page.stem}\n" in menu
        assert page.stem == "index" or f"({page.name})" in index


def test_a_page_begins_with_its_summary():
    text = reference_pages.expanded("```{reference}\ntrueangle.fit\ntrueangle.Shaft: order\n```\n")
    summary, details = text.split(".. autofunction:: trueangle.fit")
    assert "autosummary" in summary
    assert "   ~trueangle.Shaft\n" in summary
    assert ".. autoclass:: trueangle.Shaft\n   :members: order\n" in details


def test_every_cause_stands_under_the_measurement_that_shows_it():
    page = causes.causes_page()
    for kind, effect in causes.EFFECTS.items():
        heading = causes.MEASUREMENTS[causes.measurement(effect)][0]
        section = page.split(f"## {heading}\n")[1].split("\n## ")[0]
        assert f"\n`{kind}`\n" in section


def test_a_cause_that_needs_a_column_stands_under_it():
    places = {kind: causes.measurement(effect) for kind, effect in causes.EFFECTS.items()}
    assert places["backlash"] == "direction"
    assert places["torsional_compliance"] == "torque"
    assert places["current_coupling"] == "current"
    assert places["reference_error"] == "mount"
    assert places["latency"] == "velocity"


def test_class_names_are_unique():
    root = Path(trueangle.__file__).parent
    places = defaultdict(list)
    for path in sorted(root.rglob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(path.relative_to(root).as_posix())
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
    promised, planted, _ = page.partition("**Planted faults.**")
    assert planted
    rows = [line for line in promised.splitlines() if line.startswith("| ")][2:]
    assert len(rows) >= 12
    for row in rows:
        named = re.findall(r"`((?:tests|\.ci)/[^`]+)`", row)
        assert named, row
        for path in named:
            assert (ROOT / path).exists(), path


def test_every_part_of_the_night_has_a_job() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    workflow = (ROOT / ".github" / "workflows" / "nightly.yml").read_text(encoding="utf-8")
    parts = re.findall(r"^NIGHTLY = (.*)$", makefile, re.MULTILINE)[0].split()
    jobs = re.findall(r"^ +part: \[(.*)\]$", workflow, re.MULTILINE)[0].split(", ")
    assert len(parts) >= 8
    assert sorted(parts) == sorted(jobs)
    for part in parts:
        assert re.search(rf"^{part}:.*##", makefile, re.MULTILINE), part


def resolved(path):
    """What a dotted path names; the longest part that is a module is imported."""
    parts = path.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError as missing:
            if missing.name is None or not missing.name.startswith("trueangle"):
                return None  # an extra that is not installed
            continue
        for name in parts[cut:]:
            found = getattr(found, name)
        return found
    raise AssertionError(f"{path}: no such module")


def documented():
    """Everything that the reference lists, members that are named included."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from reference_pages import BLOCK, entries
    finally:
        sys.path.pop(0)
    paths = []
    for page in sorted((ROOT / "docs" / "reference").glob("*.md")):
        for block in BLOCK.findall(page.read_text("utf-8")):
            for name, members in entries(block):
                paths.append(name)
                paths += [f"{name}.{member.strip()}" for member in members.split(",") if member]
    assert len(paths) > 50
    return paths


def told_in_changelog():
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    paths = {
        path.rstrip(".")
        for quoted in re.findall(r"`([^`]+)`", text)
        for path in re.findall(r"(?<![\w/-])(?:ta|trueangle)(?:\.[A-Za-z_]\w*)+", quoted)
    }
    return sorted({re.sub(r"^ta\b", "trueangle", path) for path in paths})


@pytest.mark.parametrize("listed", [documented, told_in_changelog])
def test_names_in_the_documentation_exist(listed):
    missing = []
    for path in listed():
        try:
            resolved(path)
        except (AssertionError, AttributeError) as error:
            missing.append(f"{path}: {error}")
    assert not missing


def test_an_unknown_name_is_refused():
    with pytest.raises(ModuleNotFoundError, match=r"trueangle\.nothing"):
        importlib.import_module("trueangle.nothing")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = ta.nothing
