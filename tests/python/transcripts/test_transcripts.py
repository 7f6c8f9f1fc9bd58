"""Everything that commands print and write, against what was read and approved.

A change of a number, a word or a count that a user reads shows here as the lines that it
changes. Where the change is meant, ``make transcripts`` writes them anew: read the difference
before it is committed, as whoever reviews it will.
"""

from __future__ import annotations

import os
import re

import pytest

from .asked import NOTHING
from .desk import furnish
from .terminal import Terminal
from .transcript import HERE, Step, differences, is_same_number, steps_of, text_of

pytest.importorskip("matplotlib").use("Agg")

#: Half a second and more each.
SLOW = re.compile(
    "asked|causes|certificate|charts|demo|diagnose|export|joints|pages|pictures|plan|report|targets|words"
)

#: Why an option of a command may change nothing, of all that `asked` gives.
IDLE = {
    "--checksums": "a fit in memory keeps them by itself",
    "--counts-per-turn": "of a picture of a model it is the unit of --errors-in count",
    "--fixed-member": "says what a --gear-ratio means, and the file has only",
    "--progress": "nothing is told of work that is done at once",
    "--robot": "the file of the models names the same columns",
}

NAMES = [
    pytest.param(path.stem, marks=[pytest.mark.slow] * bool(SLOW.match(path.stem)))
    for path in sorted(HERE.glob("approved/*.txt"))
]
WRITES = os.environ.get("TRUEANGLE_APPROVE") == "1"


@pytest.mark.parametrize("name", NAMES)
def test_what_is_shown(name, tmp_path):
    path = HERE / "approved" / f"{name}.txt"
    steps = steps_of(path.read_text(encoding="utf-8"))
    assert steps, f"{path.name} holds no command"
    furnish(tmp_path)
    terminal = Terminal(tmp_path)
    found, failed = [], []
    for step in steps:
        lines = terminal.lines(step.command)
        found.append(step._replace(lines=tuple(lines)))
        failed += [f"$ {step.command}", *wrong] if (wrong := differences(step.lines, lines)) else []
    if WRITES:
        path.write_text(text_of(found), encoding="utf-8")
    else:
        told = "\n".join(failed)
        assert not failed, f"{path.name} (meant? `make transcripts`, then read it):\n{told}"


def test_no_option_is_given_in_vain():
    steps = steps_of((HERE / "approved" / "asked.txt").read_text(encoding="utf-8"))
    idle = {x.split()[0].rstrip(":") for step in steps for x in step.lines if x.endswith(NOTHING)}
    assert idle == IDLE.keys()


def test_a_transcript_reads_back():
    steps = [Step(("# Why.",), "show a", ("one", "", "  two")), Step((), "show b", ())]
    assert steps_of(text_of(steps)) == steps


@pytest.mark.parametrize(
    ("was", "now", "same"),
    [("1.234", "1.235", True), ("1.234", "1.236", False), ("360", "361", False),
     ("0.5", "0.6", False), ("-1.234", "1.234", False), ("1.23457e-05", "1.23456e-05", True),
     ("6.0495689082979975", "6.0495689082971", True), ("6.0495689082979975", "6.04957", False),
     ("6.0495689082979975", "6.0496", False), ("12.3", "12.4", True),
     ("123456", "123457", False), ("1.2e+02", "1.3e+02", False), ("0.5", "0.50", False),
     ("0.000", "0.00", False), ("360", "360.0", False),
     ("0.899286", "0.899275", True), ("0.899286", "0.8993", True), ("0.899286", "0.899386", False)],
)  # fmt: skip
def test_numbers_may_differ_in_their_last_digit_and_counts_may_not(was, now, same):
    assert is_same_number(was, now) == same


@pytest.mark.parametrize(
    ("was", "now"),
    [("rms 1.234 arcsec", "rms 1.234 deg"), ("3 runs", "4 runs"), ("a", None), (None, "a"),
     ("std 0.498", "std 0.996")],
)  # fmt: skip
def test_a_change_is_told(was, now):
    found = differences(*([text] if text else [] for text in (was, now)))
    assert found == [f"  was: {was}", f"  is:  {now}"]
