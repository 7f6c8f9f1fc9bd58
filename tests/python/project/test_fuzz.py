"""A short fuzz of every loader; `make fuzz` is the long one."""

import os
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).resolve().parents[2] / "fuzz"
sys.path.insert(0, str(FUZZ))

from loaders import loaders  # noqa: E402
from mutation import NASTY, mutated_document  # noqa: E402

#: Damaged files of each loader.
CASES = 40


@pytest.mark.skipif(sys.platform == "win32", reason="memory is bounded by RLIMIT_AS")
@pytest.mark.parametrize("name", loaders())
def test_damaged_files_are_read_or_refused(name):
    # The same files each time: what others find, found at night, belongs to no change.
    seed = int(os.environ.get("TRUEANGLE_FUZZ_SEED", "20261126"))
    print("seed", seed)
    command = [sys.executable, str(FUZZ), "--loader", name, "--cases", str(CASES)]
    done = subprocess.run(
        [*command, "--seed", str(seed)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_case_leaves_nothing_behind_for_the_next():
    """Each is made from its number alone: what the damage is made of stays as it was."""
    before = repr(NASTY)
    rng = random.Random(7)
    made = {"a": [1, {"b": 2.0}]}
    for _ in range(3000):
        made = mutated_document(made, rng)
        if not isinstance(made, dict) or len(repr(made)) > 2000:
            made = {"a": [1, {"b": 2.0}]}
    assert repr(NASTY) == before


@pytest.mark.skipif(sys.platform == "win32", reason="memory is bounded by RLIMIT_AS")
def test_a_long_fuzz_that_is_stopped_says_how_far_it_came():
    command = [sys.executable, "-u", str(FUZZ), "--loader", "model", "--cases", "1000000"]
    command += ["--seed", "20261126"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as fuzz:
        assert fuzz.stdout is not None
        assert fuzz.stdout.readline().startswith("seed ")
        with pytest.raises(subprocess.TimeoutExpired):
            fuzz.wait(timeout=2.0)
        fuzz.terminate()
        told = fuzz.stdout.read()
    assert re.fullmatch(r"model: \d+ cases, \d+ read, 0 failed, \d+ s\n", told), told
    assert fuzz.returncode == 1
