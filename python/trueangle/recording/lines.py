"""How the lines of a source are laid out: found by the first ones, or a pattern that is given."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from ..errors import ArgumentError
from ..formats.seriallog import NUMBER, PAIR

#: Lines that agree on their layout.
_ENOUGH: Final = 3
_VALUE: Final = rb"(%s)" % NUMBER

#: A name of a column, which no sentence is.
_NAME: Final = re.compile(r"-?[A-Za-z_][^,;\t]*(?<![.:!?])")

#: Cells of a line, or None where it is no row.
Cells = Callable[[bytes], Sequence[bytes] | None]


class LineLayout(NamedTuple):
    """How lines are read.

    Attributes
    ----------
    kind : str
        As it is shown: ``"CSV"``, ``"name:value pairs"``, ``"numbers"``, ``"JSON"``, ``"pattern"``.
    names : tuple of str
    cells : callable
        Cells of a line, one for each name; None of a line that is no row.
    header : bytes or None
        The line that named the columns: it is no row where it comes again.
    every : pattern or None
        What matches each line of many that are rows.
    """

    kind: str
    names: tuple[str, ...]
    cells: Cells
    header: bytes | None = None
    every: re.Pattern[bytes] | None = None

    def rows(self, lines: Sequence[bytes]) -> list[Sequence[bytes] | None]:
        """Cells of each line; all at once where all are rows, which is five times as fast."""
        if self.every is not None and len(self.names) > 1:
            found = self.every.findall(b"\n".join(lines))
            if len(found) == len(lines):
                return found
        return [*map(self.cells, lines)]


class _Seen(NamedTuple):
    """What one line alone shows of the layout."""

    kind: str
    names: tuple[str, ...] | int
    between: bytes = b""


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
    counts: Counter[_Seen] = Counter()
    best = None
    for found in filter(None, seen):
        counts[found] += 1
        if counts[found] == _ENOUGH:
            best = found
            break
    if best is None and hurry and counts:
        best = counts.most_common(1)[0][0]
    if best is None:
        return None
    if best.kind == "JSON":
        return LineLayout("JSON", best.names, _json_cells(best.names))  # type: ignore[arg-type]
    if best.kind == "name:value pairs":
        names: Any = best.names
        pairs = [rb"%s[ \t]*[:=][ \t]*%s" % (re.escape(name.encode()), _VALUE) for name in names]
        return _matching(best.kind, names, rb"[ \t,;]+".join(pairs))
    width: Any = best.names
    before = lines[: seen.index(best)]
    header = next((line for line in reversed(before) if _named(line, best.between, width)), None)
    names = _named(header, best.between, width) if header is not None else None
    between = {b" ": rb"[ \t]+", b"\t": rb" *\t *"}.get(
        best.between, rb"[ \t]*%s[ \t]*" % best.between
    )
    given = names or tuple(f"column{i + 1}" for i in range(width))
    return _matching(best.kind, given, between.join([_VALUE] * width), header)


def layout_of_names(names: tuple[str, ...]) -> LineLayout | None:
    """The layout of CSV whose columns are known; None where there are none."""
    return _matching("CSV", names, b",".join([_VALUE] * len(names))) if names else None


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
    groups = list(found.groupindex.values())
    number = re.compile(_VALUE)

    def cells(line: bytes) -> Sequence[bytes] | None:
        match = found.search(line)
        given = match.group(0, *groups)[1:] if match else [b""]
        return given if all(cell and number.fullmatch(cell) for cell in given) else None

    return LineLayout("pattern", tuple(found.groupindex), cells)


def _seen(line: bytes) -> _Seen | None:
    text = line.strip()
    if text.startswith(b"{"):
        names = tuple(_numbers(text))
        return _Seen("JSON", names) if names else None
    pairs = PAIR.findall(text)
    if pairs and not PAIR.sub(b"", text).strip(b" \t,;"):
        return _Seen("name:value pairs", tuple(name.decode("ascii") for name, _ in pairs))
    between = next((mark for mark in (b";", b",", b"\t") if mark in text), b" ")
    parts = _split(text, between)
    if not parts or not all(re.fullmatch(NUMBER, part.strip()) for part in parts):
        return None
    return _Seen("numbers" if between == b" " else "CSV", len(parts), between)


def _split(text: bytes, between: bytes) -> list[bytes]:
    text = text.strip()
    return text.split() if between == b" " else text.removesuffix(between).split(between)


def _named(line: bytes, between: bytes, width: int) -> tuple[str, ...] | None:
    """Names that a line gives to so many columns."""
    try:
        names = tuple(part.decode().strip().strip('"') for part in _split(line, between))
    except UnicodeDecodeError:
        return None
    words = all(name.isprintable() and _NAME.fullmatch(name) for name in names)
    return names if words and len(set(names)) == len(names) == width else None


def _matching(
    kind: str, names: tuple[str, ...], pattern: bytes, header: bytes | None = None
) -> LineLayout:
    """The layout of lines that match a pattern with a group for each column."""
    # Each has one way to match: a line of blanks costs its length.
    whole = re.compile(pattern + rb"[,;]?")

    def cells(line: bytes) -> Sequence[bytes] | None:
        match = whole.fullmatch(line.strip())
        return match.groups() if match else None

    return LineLayout(kind, names, cells, header, re.compile(rb"^%s$" % pattern, re.MULTILINE))


def _numbers(text: bytes) -> dict[str, float]:
    """Numbers of an object by their names, those of objects within it behind a dot."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    flat: dict[str, float] = {}

    def add(values: dict[str, Any], before: str) -> None:
        for name, value in values.items():
            if isinstance(value, dict):
                add(value, f"{before}{name}.")
            elif isinstance(value, int | float) and not isinstance(value, bool):
                flat[before + name] = value

    if isinstance(found, dict):
        add(found, "")
    return flat


def _json_cells(names: tuple[str, ...]) -> Cells:
    def cells(line: bytes) -> Sequence[bytes] | None:
        found = _numbers(line)
        try:
            return [repr(found[name]).encode() for name in names]
        except KeyError:
            return None

    return cells
