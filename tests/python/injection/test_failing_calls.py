"""Every call of the system that can fail fails once, in every command: nothing is half-written."""

import os
import shutil
import signal

import pytest

from .conftest import COMMANDS, commands, furnish, tree
from .shim import IO_ERROR, NO_SPACE, TOO_MANY_FILES

#: What fails, how, and with which error of the system.
FAILURES = {
    "open": ("open", "fail", TOO_MANY_FILES),
    "read": ("read", "fail", IO_ERROR),
    "write": ("write", "fail", NO_SPACE),
    "short write": ("write", "half", 0),
    "sync": ("sync", "fail", IO_ERROR),
    "rename": ("rename", "fail", IO_ERROR),
    "folder": ("folder", "fail", NO_SPACE),
}

#: Far more calls than any of the small commands makes.
MOST = 400


def same(name, content, whole):
    """Whether a file is the whole one: reports and models note when they were made."""
    if name.endswith(("jsonl", ".json", ".html")):
        return abs(len(content) - len(whole)) < 200 and content.rstrip()[-6:] == whole.rstrip()[-6:]
    return content == whole


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("command", commands())
def test_the_nth_call_fails(command, failure, driver, expected, tmp_path):
    kind, action, error = FAILURES[failure]
    written, counts = expected[command]
    arguments, output = COMMANDS[command]
    assert (counts[kind] > 0) or kind in ("sync", "rename", "folder")
    desk = tmp_path / "desk"
    furnish(desk)
    inputs = tree(desk)
    failed = 0
    for n in range(MOST):
        answer = driver.run(desk, arguments, kind=kind, n=n, action=action, error=error)
        struck = answer.counts.get(kind, MOST) > n
        after = tree(desk)
        assert {k: after.get(k) for k in inputs} == inputs, (n, "an input was changed")
        left = [k for k in after if ".trueangle-partial" in k]
        assert not left, (n, left, answer.told)
        for k in after.keys() - inputs.keys() - {"out/trueangle-manifest.jsonl"}:
            assert same(k, after[k], written[k]), (n, k)
        if answer.status == 0:
            done = {k for k in after if k not in inputs}
            assert done == written.keys(), (n, done, answer.told)
        else:
            failed += 1
            assert answer.status == 1, (n, answer)
            lines = [
                line for line in answer.told.splitlines() if line.startswith("trueangle: error")
            ]
            assert len(lines) == 1, (n, answer.told)
            assert "Traceback" not in answer.told
            assert "defect of trueangle" not in answer.told, (n, answer.told)
        if command == "correct":  # goes on where it stopped, to the same bytes
            again = driver.run(desk, arguments)
            assert again.status == 0, (n, again.told)
            done = {k: v for k, v in tree(desk).items() if k.endswith(".csv")}
            assert done == {k: v for k, v in {**inputs, **written}.items() if k.endswith(".csv")}
        for name in (output, "x.csv"):
            path = desk / name
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        if not struck:
            break
    else:
        raise AssertionError(f"more than {MOST} calls")
    # Where clearing up itself has failed, the next run has more to do.
    assert n >= counts[kind], "the calls changed from run to run"
    assert not list(desk.rglob("*.trueangle-partial"))
    # Only reading again after an interrupted call, and writing on after half a write, may pass.
    assert failed > 0 or action == "half" or counts[kind] == 0


@pytest.mark.parametrize("kind", ["open", "write", "sync", "rename"])
@pytest.mark.parametrize("way", ["folder", "in place"])
def test_killed_at_the_nth_call_then_resumed(way, kind, driver, expected, tmp_path):
    """Struck before every single call; what has its final name is complete."""
    whole = expected["correct"][0]
    arguments = COMMANDS["correct"][0]
    outputs = {f"out/{x}": whole[f"out/{x}"] for x in ("a.csv", "b.csv")}
    if way == "in place":
        arguments = [*arguments[:-2], "--in-place"]
        outputs = {k.replace("out/", "logs/"): v for k, v in outputs.items()}
    struck = 0
    for n in range(MOST):
        desk = tmp_path / str(n)
        furnish(desk)
        inputs = tree(desk)
        answer = driver.run(desk, arguments, kind=kind, n=n, action="kill")
        if answer.status == 0:
            break
        assert answer.status == -signal.SIGKILL, answer
        struck += 1
        now = tree(desk)
        for name, content in outputs.items():
            assert now.get(name) in (inputs.get(name), content), (n, name)
        again = driver.run(desk, arguments)
        assert again.status == 0, (n, again.told)
        now = tree(desk)
        assert {name: now[name] for name in outputs} == outputs
        assert not [name for name in now if "partial" in name]
        shutil.rmtree(desk)
    assert struck > 0
    print(f"{struck} kills")


#: Kills at random moments of each command.
KILLS = int(os.environ.get("TRUEANGLE_KILLS", "12"))


@pytest.mark.parametrize("command", commands())
def test_killed_at_random_moments(command, driver, expected, tmp_path):
    import random
    import time

    seed = random.SystemRandom().randrange(2**32)
    print("seed", seed)
    rng = random.Random(seed)
    arguments, _ = COMMANDS[command]
    desk = tmp_path / "desk"
    furnish(desk)
    inputs, written = tree(desk), expected[command][0]
    start = time.monotonic()
    assert driver.run(desk, arguments).status == 0
    seconds = time.monotonic() - start
    struck = 0
    for _ in range(20 * KILLS):
        shutil.rmtree(desk)
        furnish(desk)
        answer = driver.run(desk, arguments, kill_after=rng.uniform(0.0, seconds))
        after = tree(desk)
        assert {k: after.get(k) for k in inputs} == inputs
        for k in after.keys() - inputs.keys() - {"out/trueangle-manifest.jsonl"}:
            assert ".trueangle-partial" in k or same(k, after[k], written[k]), k
        if answer.status == -signal.SIGKILL:
            struck += 1
            again = driver.run(desk, arguments)
            assert again.status == 0, again.told
            after = tree(desk)
            assert all(same(k, after[k], v) for k, v in written.items() if "manifest" not in k)
        else:
            assert answer.status == 0, answer
        if struck == KILLS:
            break
    assert struck == KILLS, "the kills came too late"
