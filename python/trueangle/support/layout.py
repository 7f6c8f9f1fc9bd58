"""Text for people: counts in words, lines no wider than the terminal, folded under their text."""

from __future__ import annotations

import math
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Final

#: Columns of a line at least and at most; without a terminal it is `_USUAL`.
_NARROWEST, _WIDEST, _USUAL = 60, 100, 80

#: Columns where nothing is to be folded.
_UNFOLDED: Final = ContextVar("unfolded", default=False)


#: The character that replaces a blank at which no line is cut.
_JOINED: Final = "\0"

#: Further lines of an entry are aligned with the text behind its mark, number or label.
_LEAD: Final = re.compile(r"\s*(?:- |! |\[\d+\] |\d+\. |note: |\S.{0,28}? {2,}(?=\S))?")


@contextmanager
def unfolded_text() -> Iterator[None]:
    """Within it every line of a text is as long as it is: who shows it folds it.

    Examples
    --------
    >>> with unfolded_text():
    ...     len(wrapped_lines("a word and " * 50))
    1
    """
    before = _UNFOLDED.set(True)
    try:
        yield
    finally:
        _UNFOLDED.reset(before)


def text_columns() -> int:
    """Columns that a text may have: the terminal's (``COLUMNS``), within readable bounds.

    Examples
    --------
    >>> 60 <= text_columns() <= 100
    True
    """
    if _UNFOLDED.get():
        # Nothing is folded.
        return 1_000_000
    # As `shutil.get_terminal_size` has it, whose import costs more than a small fit.
    found = 0
    with suppress(ValueError):
        found = int(os.environ.get("COLUMNS", 0))
    if found <= 0:
        with suppress(AttributeError, ValueError, OSError):
            found = os.get_terminal_size(sys.__stdout__.fileno()).columns  # type: ignore[union-attr]
    return min(max(found or _USUAL, _NARROWEST), _WIDEST)


def wrapped_lines(text: str, indent: int = 0, first: int = 0) -> list[str]:
    """Lines of a paragraph; ``first`` and ``indent`` indent the first line and the others.

    Words are never broken, so that options and paths can be copied.

    Examples
    --------
    >>> wrapped_lines("a word and " * 8 + "an end", indent=2)[1]
    '  word and an end'
    """
    lines = textwrap.wrap(
        _whole_code(text),
        text_columns(),
        initial_indent=" " * first,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(_JOINED, " ") for line in lines]


def laid_out(lines: Iterable[str]) -> str:
    """Lines as one text; what is too long is folded under the text behind its label.

    Examples
    --------
    >>> print(laid_out(["  noise    " + "of one reading, " * 5]))
      noise    of one reading, of one reading, of one reading, of one reading, of
               one reading,
    """
    width = text_columns()
    found: list[str] = []
    for line in lines:
        # How lines begin that are meant to be copied and are not folded.
        if len(line) <= width or line.lstrip().startswith(("--", "trueangle ")):
            found.append(line)
            continue
        lead = _LEAD.match(line)
        indent = max(lead.end() if lead else 0, 2)
        # Fewest columns for the words behind a label; with fewer they are put below it.
        found += _folded(line, width, indent if indent <= width - 20 else 2)
    return "\n".join(found)


def _folded(line: str, width: int, indent: int) -> list[str]:
    """One line as several, cut at blanks."""
    parts: list[str] = []
    line = _whole_code(line)
    while len(line) > width:
        cut = line.rfind(" ", indent + 1, width + 1)
        cut = cut if cut > 0 else line.find(" ", width)
        if cut < 0:
            break
        parts.append(line[:cut].rstrip())
        line = " " * indent + line[cut:].lstrip()
    return [part.replace(_JOINED, " ") for part in (*parts, line.rstrip())]


def _whole_code(text: str) -> str:
    """``text`` with no blank in the code that backquotes hold: it is there to be copied."""
    return re.sub(r"`[^`\n]+`", lambda code: code[0].replace(" ", _JOINED), text)


def counted(things: Sized | int, one: str, several: str = "") -> str:
    """How many there are, in words.

    Examples
    --------
    >>> counted(1, "run"), counted([1, 2], "run"), counted(0, "reversal", "reversals")
    ('1 run', '2 runs', '0 reversals')
    """
    n = things if isinstance(things, int) else len(things)
    return f"{n} {one if n == 1 else several or one + 's'}"


def order_ranges(orders: Sequence[float]) -> str:
    """Orders in words: ``1 to 4, 8``.

    Examples
    --------
    >>> order_ranges([1, 2, 3, 4, 8, 7.3])
    '1 to 4, 7.3, 8'
    """
    parts: list[str] = []
    run: list[float] = []
    for order in [*sorted(orders), math.inf]:
        if run and (order != run[-1] + 1.0):
            parts.append(
                f"{run[0]:g} to {run[-1]:g}" if len(run) > 2 else ", ".join(f"{k:g}" for k in run)
            )
            run = []
        run.append(order)
    return ", ".join(parts)


def run_name(label: str) -> str:
    """What a text calls a run: ``run LABEL``, or the label where it begins with that word.

    Examples
    --------
    >>> run_name("3"), run_name("Run 3")
    ('run 3', 'Run 3')
    """
    return label if label.lower().startswith("run") else f"run {label}"
