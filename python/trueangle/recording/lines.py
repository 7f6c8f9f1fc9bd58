"""How the lines of a source are laid out: found by the first ones, or a pattern that is given."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..formats.seriallog import NUMBER
from ..support.arrays import Array

#: Lines that agree on their layout.
_ENOUGH: Final = 3
_NUMBER: Final = re.compile(rb"(?<![\w.])%s(?![\w.])" % NUMBER)
#: What is between two numbers where several blanks are one: a mark, and the name of the second.
_BLANKS: Final = re.compile(rb"([ \t])[ \t]+")
_GAP: Final = re.compile(
    rb" ?([,;\t]?)[ \t]?(?:([A-Za-z_][\w.\[\]/-]*(?: [\w.\[\]/-]+){0,4})[ \t]?[:=])?[ \t]?"
)
#: A name of a column, which no sentence is.
_NAME: Final = re.compile("-?[A-Za-z_][^,;\t\ufffd]*(?<![.:!?])")


class LineLayout(NamedTuple):
    """How lines are read.

    Attributes
    ----------
    kind : str
        As it is shown: ``"CSV"``, ``"name:value pairs"``, ``"numbers"``, ``"JSON"``, ``"pattern"``.
    names : tuple of str
    row : pattern or None
        What a line that is a row holds, a named group for each name; None of JSON.
    header : bytes or None
        The line that named the columns: it is no row where it comes again.
    """

    kind: str
    names: tuple[str, ...]
    row: re.Pattern[bytes] | None = None
    header: bytes | None = None

    def values(self, lines: Sequence[bytes]) -> Array:
        """Numbers of each line, shape (n, columns); NaN of one that is no row."""
        cells = chain.from_iterable(map(self._cells, lines))
        return np.fromiter(map(float, cells), float).reshape(len(lines), len(self.names))

    def _cells(self, line: bytes) -> Sequence[bytes | float]:
        if self.row is None:
            found = _numbers(line)
            return [found.get(name, math.nan) for name in self.names]
        match = self.row.search(line)
        cells = [*match.groupdict(b"").values()] if match else []
        if self.kind == "pattern" and not all(map(_NUMBER.fullmatch, cells)):
            cells = []
        return cells or [math.nan] * len(self.names)


def layout_of(lines: Sequence[bytes], hurry: bool = False) -> LineLayout | None:
    r"""The layout on which three lines agree; in a hurry, that of most lines.

    Examples
    --------
    >>> layout_of([b"Ready.", b"step:8 raw:123", b"step:9 raw:125", b"step:10 raw:127"]).names
    ('step', 'raw')
    >>> layout_of([b"reference_deg,indicated_deg", b"1,2", b"2,3", b"3,4"]).kind
    'CSV'
    """
    seen = [_seen(line) for line in lines]
    counts = Counter(filter(None, seen))
    enough = [found for found, count in counts.items() if count >= _ENOUGH]
    if not (enough or (hurry and counts)):
        return None
    best = (enough or [counts.most_common(1)[0][0]])[0]
    if isinstance(best[0], str):
        return LineLayout("JSON", best)
    marks, named = zip(*best, strict=True)
    mark = (*marks[1:], b"")[0]
    kind = "name:value pairs" if any(named) else "CSV" if mark else "numbers"
    heads = ((line.strip(), _head(line, mark)) for line in reversed(lines[: seen.index(best)]))
    header, head = next((h for h in heads if h[1] and len(h[1]) == len(best)), (None, ()))
    given = [name.decode() or f"column{i}" for i, name in enumerate(named, 1)]
    return layout_of_columns(kind, head or tuple(given), best, header)


def layout_of_columns(
    kind: str,
    names: tuple[str, ...],
    gaps: Sequence[tuple[bytes, bytes]] = (),
    header: bytes | None = None,
) -> LineLayout:
    """The layout of lines of numbers, with a mark and a name before each: of CSV without any."""
    # Each has one way to match: a long line of rubbish costs its length.
    row = rb"^\s*"
    for i, (mark, name) in enumerate(gaps or [(b",", b"")] * len(names)):
        between = rb" *%s[ \t]*" % mark if mark else rb"[ \t]+"
        label = rb"%s[ \t]*[:=][ \t]*" % re.escape(name) if name else b""
        row += (between if i else b"") + label + rb"(?P<c%d>%s)" % (i, NUMBER)
    return LineLayout(kind, names, re.compile(row + rb"(?:[ \t]*[,;])?\s*$"), header)


def layout_of_pattern(pattern: str) -> LineLayout:
    """The layout that a regular expression with named groups states; found anywhere in a line.

    Raises
    ------
    ArgumentError
        It is no such expression.
    """
    try:
        found = re.compile(pattern.encode())
    except re.error as error:
        raise ArgumentError(f"pattern {pattern!r} is no regular expression: {error}") from None
    if not found.groupindex:
        raise ArgumentError(
            f"pattern {pattern!r} names no group; name columns as in 'S(?P<step>\\d+) "
            "R(?P<raw>\\d+)'"
        )

    return LineLayout("pattern", tuple(found.groupindex), found)


def _seen(line: bytes) -> tuple[Any, ...] | None:
    """What one line alone shows of the layout: marks and names of its numbers, or those of JSON."""
    text = line.strip()
    if text.startswith(b"{"):
        return tuple(_numbers(text)) or None
    *gaps, end = _NUMBER.split(_BLANKS.sub(rb"\1", text))
    found = [match.groups(b"") for match in map(_GAP.fullmatch, gaps) if match]
    is_row = 0 < len(found) == len(gaps) and not found[0][0] and not end.strip(b" ,;")
    return tuple(found) if is_row else None


def _head(line: bytes, mark: bytes) -> tuple[str, ...]:
    """Names of columns, if a line has some."""
    text = line.strip()
    parts = text.removesuffix(mark).split(mark) if mark else text.split()
    names = tuple(part.decode("utf-8", "replace").strip().strip('"') for part in parts)
    words = all(name.isprintable() and _NAME.fullmatch(name) for name in names)
    return names if words and len(set(names)) == len(names) else ()


def _numbers(text: bytes) -> dict[str, float]:
    """Numbers of an object by their names, those of objects within it behind a dot."""

    def flat(values: Any, before: str) -> Iterator[tuple[str, float]]:
        for name, value in values.items() if isinstance(values, dict) else ():
            if type(value) in (int, float):
                yield before + name, value
            yield from flat(value, f"{before}{name}.")

    try:
        return dict(flat(json.loads(text), ""))
    except (ValueError, RecursionError):
        return {}
