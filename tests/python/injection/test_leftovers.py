"""What a killed command left is removed by the next that writes there; what lives is spared."""

import os
import subprocess
import sys

import pytest

from trueangle.cli import main
from trueangle.support.files import written_atomically
from trueangle.support.files.workplace import PARTIAL, hidden_beside, made_beside, remove_leftovers

from .conftest import COMMANDS, commands, furnish, tree
from .test_failing_calls import same


@pytest.mark.parametrize("command", commands())
def test_the_next_run_removes_what_a_kill_left(command, driver, expected, tmp_path):
    """Killed before any call that changes the disk; other outputs' remains are not touched."""
    arguments, _ = COMMANDS[command]
    desk, states = tmp_path / "desk", tmp_path / "states"
    furnish(desk)
    (desk / f".y.csv.0123{PARTIAL}").write_text("of another output")
    assert driver.run(desk, arguments, states=str(states)).status == 0
    left = 0
    for state in sorted(states.iterdir()):
        partial = [p for p in state.rglob(f"*{PARTIAL}") if not p.name.startswith(".y")]
        left += bool(partial)
        assert driver.run(state, arguments).status == 0
        after = {k: v for k, v in tree(state).items() if "manifest" not in k}
        assert [k for k in after if PARTIAL in k] == [f".y.csv.0123{PARTIAL}"], state.name
        assert not [p for p in partial if p.exists()], state.name
        for name, data in expected[command][0].items():
            assert "manifest" in name or same(name, after[name], data), (state.name, name)
    assert left > 0


def test_what_lives_is_spared(desk, monkeypatch):
    monkeypatch.chdir(desk)
    with written_atomically("x.csv") as file:
        file.write("of one that is slow\n")
        assert main(COMMANDS["simulate"][0]) == 0
        quick = (desk / "x.csv").read_text()
        assert quick.startswith("run,")
        assert [p for p in desk.iterdir() if PARTIAL in p.name]
    assert (desk / "x.csv").read_text() == "of one that is slow\n"
    assert not [p for p in desk.iterdir() if PARTIAL in p.name]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_is_taken_for_a_dead_ones_is_made_again(kind, tmp_path):
    """Another process looks for leftovers between the making and the lock."""
    target = tmp_path / "x.csv"
    made = []

    def make(beside):
        made.append(beside)
        if kind == "folder":
            beside.mkdir()
        handle = os.open(beside, os.O_RDONLY | (0 if kind == "folder" else os.O_CREAT))
        if len(made) < 3:
            os.close(handle)
            remove_leftovers([target])
            assert not beside.exists()
            handle = os.open(beside, os.O_RDONLY)
        return handle

    with made_beside(target, make) as beside:
        assert beside == made[2]
        remove_leftovers([target])
        assert beside.exists()
    assert list(tmp_path.iterdir()) == []


def test_what_loses_its_name_before_it_is_locked_is_made_again(tmp_path):
    target = tmp_path / "x.csv"
    made = []

    def make(beside):
        made.append(beside)
        handle = os.open(beside, os.O_RDONLY | os.O_CREAT)
        if len(made) < 3:
            beside.unlink()
        return handle

    with made_beside(target, make) as beside:
        assert beside == made[2]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["simulate", "correct one"])
def test_three_at_once_end_well(command, desk, expected):
    """All write one output: it is a whole one, and nothing is left."""
    arguments, output = COMMANDS[command]
    started = [
        subprocess.Popen(
            [sys.executable, "-m", "trueangle", *arguments], cwd=desk, stderr=subprocess.PIPE
        )
        for _ in range(3)
    ]
    for process in started:
        told = process.communicate()[1]
        assert process.returncode == 0, told
    assert (desk / output).read_bytes() == expected[command][0][output]
    assert not list(desk.rglob(f"*{PARTIAL}"))


def test_a_name_beside_is_new_every_time(tmp_path):
    assert hidden_beside(tmp_path / "x") != hidden_beside(tmp_path / "x")
