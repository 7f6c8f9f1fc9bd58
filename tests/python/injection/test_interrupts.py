"""Ctrl-C, SIGTERM, SIGHUP with any call of the system, in every command: nothing is left."""

import shutil

import pytest

from .conftest import COMMANDS, commands, furnish, tree
from .test_failing_calls import MOST, same

#: Calls that Ctrl-C comes with: the moment between a call and what Python does next.
KINDS = ("open", "read", "write", "sync", "rename", "folder", "remove")

#: What ends a command, and how it is told: status and words.
ENDINGS = {
    "interrupt": (130, "trueangle: interrupted"),
    "terminate": (143, "trueangle: interrupted by SIGTERM"),
    "hang up": (129, "trueangle: interrupted by SIGHUP"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", commands())
def test_ctrl_c_with_the_nth_call(command, kind, driver, expected, tmp_path):
    ended_with_every_call("interrupt", command, kind, driver, expected, tmp_path)


@pytest.mark.parametrize("action", ["terminate", "hang up"])
@pytest.mark.parametrize("command", commands())
def test_a_signal_with_the_nth_call(command, action, driver, expected, tmp_path):
    """Of kill, a service manager or a closed terminal: as Ctrl-C."""
    ended_with_every_call(action, command, "change", driver, expected, tmp_path)


def ended_with_every_call(action, command, kind, driver, expected, tmp_path):
    arguments, _ = COMMANDS[command]
    ended, words = ENDINGS[action]
    whole = expected[command][0]
    struck = 0
    for n in range(MOST):
        desk = tmp_path / str(n)
        furnish(desk)
        inputs = tree(desk)
        answer = driver.run(desk, arguments, kind=kind, n=n, action=action)
        after = tree(desk)
        assert {k: after.get(k) for k in inputs} == inputs, (n, "an input was changed")
        hidden = [p.name for p in desk.rglob(".*")]
        assert not hidden, (n, answer.told)
        for name in after.keys() - inputs.keys() - {"out/trueangle-manifest.jsonl"}:
            assert same(name, after[name], whole[name]), (n, name)
        if answer.counts.get(kind, MOST) <= n:
            assert answer.status == 0, (n, answer.told)
            break
        struck += 1
        assert answer.status == ended, (n, answer)
        told = [line for line in answer.told.splitlines() if line.startswith("trueangle: ")]
        assert len(told) == 1, (n, answer.told)
        assert told[0].startswith(words), (n, answer.told)
        assert "Traceback" not in answer.told, (n, answer.told)
        if command == "correct":  # goes on where it stopped, to the same bytes
            again = driver.run(desk, arguments)
            assert again.status == 0, (n, again.told)
            done = {k: v for k, v in tree(desk).items() if k.startswith("out/") and "log" not in k}
            assert {k: done[k] for k in ("out/a.csv", "out/b.csv")} == {
                k: whole[k] for k in ("out/a.csv", "out/b.csv")
            }
        shutil.rmtree(desk)
    else:
        raise AssertionError(f"more than {MOST} calls")
    # A single file is written without a folder of its own, and renamed, not removed.
    assert struck > 0 or kind in ("folder", "remove")
