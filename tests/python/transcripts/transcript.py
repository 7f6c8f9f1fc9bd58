"""A transcript: commands, and what they showed when it was last read and approved."""

from __future__ import annotations

import re
from decimal import Decimal
from difflib import SequenceMatcher
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from .views import DIGITS

HERE = Path(__file__).parent

#: What starts a command, and what a reader is told between them.
COMMAND, REMARK = "$ ", "# "

#: Share of a number of six digits that processors may differ by.
SEARCHED = Decimal("5e-5")

_NUMBER = re.compile(r"(?<![A-Za-z_\d.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![A-Za-z_\d])")


class Step(NamedTuple):
    """One command with the remarks above it, and the lines it showed."""

    remarks: tuple[str, ...]
    command: str
    lines: tuple[str, ...]


def steps_of(text: str) -> list[Step]:
    """Steps of a transcript; a line that a command showed stands two blanks in."""
    found: list[Step] = []
    remarks: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith(COMMAND):
            found.append(Step(tuple(remarks), line.removeprefix(COMMAND), ()))
            remarks = []
        elif line.startswith("  ") or (not line and not remarks and found):
            last = found[-1]
            found[-1] = last._replace(lines=(*last.lines, line.removeprefix("  ")))
        elif line.startswith(REMARK):
            remarks.append(line)
        else:
            raise ValueError(f"line {number} is no command, remark or output: {line!r}")
    return [step._replace(lines=_trimmed(step.lines)) for step in found]


def _trimmed(lines: tuple[str, ...]) -> tuple[str, ...]:
    while lines and not lines[-1]:
        lines = lines[:-1]
    return lines


def text_of(steps: list[Step]) -> str:
    """The transcript as a file holds it."""
    return "\n".join(
        "\n".join([*step.remarks, COMMAND + step.command, *(f"  {x}".rstrip() for x in step.lines)])
        + "\n"
        for step in steps
    )


def differences(approved: tuple[str, ...], shown: list[str]) -> list[str]:
    """Lines that differ, as "was" and "is"; numbers by `is_same_number`, words to the letter."""
    before, after = [*approved], [*_trimmed(tuple(shown))]
    matcher = SequenceMatcher(None, [*map(_words, before)], [*map(_words, after)], autojunk=False)
    found = []
    for _, a, b, c, d in matcher.get_opcodes():
        for was, now in zip_longest(before[a:b], after[c:d]):
            if was is None or now is None or not _is_same_line(was, now):
                found += [f"  was: {was}", f"  is:  {now}"]
    return found


def _words(line: str) -> str:
    """A line without its numbers, whatever its columns are wide."""
    return " ".join(_NUMBER.sub("#", line).split())


def _is_same_line(was: str, now: str) -> bool:
    """Whether lines differ in the last digits of numbers alone."""
    pairs = [*zip(_NUMBER.findall(was), _NUMBER.findall(now), strict=False)]
    return _words(was) == _words(now) and all(is_same_number(a, b) for a, b in pairs)


def is_same_number(was: str, now: str) -> bool:
    """Whether ``now`` is within a unit of the last digit of ``was``; counts are exact.

    The same number with more zeros, or fewer, is told otherwise: its digits were meant.
    Sums are rounded another way on another processor, so a last digit may be another; where
    two digits are all there are it is not, for a unit of them is no rounding. Of numbers that
    are written to all their digits six count; of those of a view, whose six digits may stand at
    the end of a search, `SEARCHED` of the number.
    """
    if was == now:
        return True
    a, b = Decimal(was), Decimal(now)
    if a == b:
        return False  # with more digits, or fewer
    least, digits = sorted((len(a.as_tuple().digits), len(b.as_tuple().digits)))
    if least > DIGITS + 2:
        return abs(a - b) * 10**DIGITS <= abs(a)
    exponents = {int(a.as_tuple().exponent), int(b.as_tuple().exponent)}
    is_count = "." not in was and "e" not in was.lower()
    if digits == DIGITS and not is_count:
        return abs(a - b) <= SEARCHED * abs(a)
    digits = least
    if digits < 3 or len(exponents) > 1 or is_count:
        return a == b
    return abs(a - b) <= Decimal(1).scaleb(exponents.pop())
