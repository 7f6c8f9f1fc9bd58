"""Names and import paths that documentation and changelog promise work."""

import importlib
import re
import sys

import pytest

import trueangle as ta
from conftest import ROOT


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
