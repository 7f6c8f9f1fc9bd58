"""Killed before any call that changes the disk, correcting in place: the same command mends all.

What a kill leaves is what is on the disk at that moment: one run, stopped before every call,
shows all of them, and the command is run again from each.
"""

import shutil
import signal
from importlib.util import find_spec

import pytest

from .conftest import furnish, tree
from .logfiles import FORMATS, made_log
from .shim import Driver

#: What is written whenever a log of a folder is done, and told apart by paths and times.
MANIFEST = "trueangle-manifest.jsonl"

COMMAND = ["correct", None, "-m", "m.json", "--in-place"]


def at(desk, name, way):
    """The log on the desk, alone or in a folder of two, and the arguments that correct it."""
    furnish(desk)
    shutil.rmtree(desk / "logs")
    if way == "alone":
        more = made_log(name, desk)
        return [COMMAND[0], FORMATS[name].file, *COMMAND[2:], *more]
    (desk / "logs").mkdir()
    more = made_log(name, desk / "logs")
    found = desk / "logs" / FORMATS[name].file
    other = found.with_name(f"z_{found.name}")
    (shutil.copytree if found.is_dir() else shutil.copy)(found, other)
    return [COMMAND[0], "logs", *COMMAND[2:], *more]


@pytest.fixture(scope="module")
def driver(shim, tmp_path_factory):
    """A process that has imported what all formats need."""
    folder = tmp_path_factory.mktemp("formats")
    furnish(folder / "desk")
    there = [n for n, f in FORMATS.items() if all(map(find_spec, f.modules))]
    commands = []
    for i, name in enumerate(there):
        (folder / "desk" / str(i)).mkdir()
        more = made_log(name, folder / "desk" / str(i))
        log = f"{i}/{FORMATS[name].file}"
        commands.append(
            [COMMAND[0], log, *COMMAND[2:4], "-o", f"{i}/x_{FORMATS[name].file}", *more]
        )
    running = Driver(shim, folder / "desk", commands)
    yield running
    running.close()


def kept(desk):
    return {name: data for name, data in tree(desk).items() if MANIFEST not in name}


CASES = [
    *((name, "alone", True) for name in FORMATS),
    *((name, "alone", False) for name in FORMATS if FORMATS[name].is_folder),
    ("CSV", "in a folder", True),
    ("bag folder, sqlite3", "in a folder", False),
]


@pytest.mark.parametrize(("name", "way", "exchange"), CASES)
def test_a_kill_before_any_call_is_mended_by_the_same_command(
    name, way, exchange, driver, tmp_path
):
    for module in FORMATS[name].modules:
        pytest.importorskip(module)
    desk, states = tmp_path / "desk", tmp_path / "states"
    arguments = at(desk, name, way)
    before = kept(desk)
    whole = driver.run(desk, arguments, states=str(states), exchange=exchange)
    assert whole.status == 0, whole.told
    expected = kept(desk)
    assert expected != before
    found = sorted(states.iterdir())
    assert len(found) >= 5, "before, made aside, filled, named, cleared up"
    for state in found:
        for path, data in kept(state).items():
            if ".trueangle-partial" not in path:  # whole at every moment, if it is there
                assert data in (before.get(path), expected.get(path)), (state.name, path)
        if exchange:
            assert not [path for path in before if not (state / path).exists()], state.name
        again = driver.run(state, arguments, exchange=exchange)
        # What has been done once is not done again: a folder's manifest knows, a log says so.
        known = way == "alone" and "corrected before" in again.told
        assert again.status == (1 if known else 0), (state.name, again)
        assert kept(state) == expected, state.name
        assert not [p for p in state.rglob("*") if "partial" in p.name], state.name
        shutil.rmtree(state)


@pytest.mark.parametrize("reader", ["orders", "check"])
def test_a_command_that_reads_gives_a_bag_its_name_again(reader, driver, tmp_path):
    """Killed between the two renames where names cannot be exchanged."""
    pytest.importorskip("rosbags")
    desk = tmp_path / "desk"
    arguments = at(desk, "bag folder, sqlite3", "alone")
    before = tree(desk)
    for n in range(99):
        answer = driver.run(desk, arguments, kind="rename", n=n, action="kill", exchange=False)
        if not (desk / "bag").exists():
            break
        assert answer.status == -signal.SIGKILL, answer
    named = ["--signal", "reference=elbow", "--signal", "indicated=elbow"]
    again = driver.run(desk, [reader, "bag", *named])
    assert "No such file" not in again.told
    assert {name: data for name, data in tree(desk).items() if "partial" not in name} == before
