"""Ctrl-C with every call of the system, in every command: nothing is half-written or left."""

import shutil

import pytest

from .conftest import COMMANDS, commands, furnish, tree
from .test_failing_calls import MOST, same

#: Calls that Ctrl-C comes with: the moment between a call and what Python does next.
KINDS = ("open", "read", "write", "sync", "rename", "folder", "remove")

INTERRUPTED = 130


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", commands())
def test_ctrl_c_with_the_nth_call(command, kind, driver, expected, tmp_path):
    arguments, _ = COMMANDS[command]
    whole = expected[command][0]
    struck = 0
    for n in range(MOST):
        desk = tmp_path / str(n)
        furnish(desk)
        inputs = tree(desk)
        answer = driver.run(desk, arguments, kind=kind, n=n, action="interrupt")
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
        assert answer.status == INTERRUPTED, (n, answer)
        told = [line for line in answer.told.splitlines() if line.startswith("trueangle: ")]
        assert len(told) == 1, (n, answer.told)
        assert told[0].startswith("trueangle: interrupted"), (n, answer.told)
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
