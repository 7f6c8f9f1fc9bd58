"""The table of rooms and the architecture page say where things are, and they are there."""

import re
import tomllib

import pytest

from conftest import ROOT

PACKAGE = ROOT / "python" / "trueangle"
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")


def rooms_of_the_table():
    start, end = (CONTRIBUTING.index(f"<!-- {mark} -->") for mark in ("rooms", "end of rooms"))
    firsts = re.findall(r"^\| (`[^|]+) \|", CONTRIBUTING[start:end], re.MULTILINE)
    return [name.rstrip("/") for cell in firsts for name in re.findall(r"`([^`]+)`", cell)]


def test_the_table_has_every_room_in_the_order_of_the_floors():
    floors = tomllib.loads((ROOT / ".ci" / "arrows.toml").read_text("utf-8"))["floors"]
    assert rooms_of_the_table() == [room for room in floors if not room.startswith("_")]
    there = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    there |= {path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith("_")}
    assert set(rooms_of_the_table()) == there


@pytest.mark.parametrize("place", sorted(set(re.findall(r"`([\w/]+(?:/|\.py|\.rs))`", PAGE))))
def test_what_the_page_names_is_there(place):
    assert (PACKAGE / place).exists() or (ROOT / place).exists()


def test_tests_mirror_rooms():
    """A folder of tests is a room's, or one of those that belong to none."""
    apart = {"core", "hidden", "injection", "project"}
    folders = {path.parent.name for path in (ROOT / "tests" / "python").glob("*/__init__.py")}
    assert folders - apart <= set(rooms_of_the_table())
    assert not [path.name for path in (ROOT / "tests" / "python").glob("test_*.py")]


def test_what_is_slow_is_there():
    here = ROOT / "tests" / "python"
    lines = (here / "slow.txt").read_text("utf-8").splitlines()
    named = [line for line in lines if line and not line.startswith("#")]
    assert [name for name in named if not (here / name).exists()] == []
    assert len(named) == len(set(named))
