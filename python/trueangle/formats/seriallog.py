"""Serial logs of named values, ``angle:1.25,target:1.5``: rows among other output of a firmware.

A row is a line of pairs of a name and a number, with ``:`` or ``=`` between them; the clock that
a terminal writes before it (``12:34:56.789 ->``) becomes ``time_s``. Other lines are words.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import FileError
from .format import Batch, Contents, CopyTask, Selection
from .textfile import TextFile, create_text, open_text, warn_of_messages

# Each has one way to match, and a name begins where a word does: a long line of rubbish costs its
# length, not the square of it.
#: A number as firmware prints it.
NUMBER = rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_VALUE = NUMBER + rb"|[+-]?(?:nan|inf)"
_NAME = rb"(?<![\w.\[\]/-])[A-Za-z_][\w.\[\]/-]*(?: [\w.\[\]/-]+){0,4}"
#: A pair of a name and a number.
PAIR = re.compile(rb"(%s)[ \t]*[:=][ \t]*(%s)(?![\w.])" % (_NAME, _VALUE), re.IGNORECASE)
_CLOCK = re.compile(rb"(\d\d):(\d\d):(\d\d(?:\.\d+)?)\s*->\s*")
_BETWEEN = b" \t,;"
_TIME = "time_s"
_DAY = 86400.0
#: Lines taken together, and the longest that is read.
_BLOCK = 1 << 14


class _Row(NamedTuple):
    """Values by name, the clock before them, and the number of the line."""

    values: dict[str, float]
    clock: float | None
    line: int


def columns(path: Path, topic: str | None = None) -> list[str]:
    """The names in the order in which they come, after the time where lines have one."""
    names: dict[str, None] = {}
    for _raw, row in _lines(path):
        if row is not None:
            if row.clock is not None and not names:
                names[_TIME] = None
            names.update(dict.fromkeys(row.values))
    if not names:
        raise FileError(path, "has no row of names and numbers, as angle:1.25", line=1)
    return list(names)


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns in batches, NaN where a row lacks a name; see `format.FormatModule`."""
    words: list[tuple[int, str]] = []
    block: list[_Row] = []
    values = _clocked(wanted.names)
    for number, (raw, row) in enumerate(_lines(path), 1):
        if row is not None:
            block.append(row)
        elif raw.strip():
            words.append((number, raw.decode("utf-8", "replace").strip()))
        if len(block) == _BLOCK:
            yield values(block)
            block = []
    if block:
        yield values(block)
    warn_of_messages(path, words)


def line_of(path: Path, row: int) -> int:
    """The line of the file that a row came from."""
    rows = (found.line for _raw, found in _lines(path) if found is not None)
    return next((line for i, line in enumerate(rows) if i == row), row)


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with a pair more at the end of every row; see `format.FormatModule`."""
    additions = task.choose(columns(task.source))
    used = [name for a in additions for name in (a.column, *a.signals.values())]
    values = _clocked(used)
    rows, check = 0, 0
    with open_text(task.source) as file, create_text(task.target) as output:
        for lines in _blocks(task.source, file):
            found = [row for _raw, row in lines if row is not None]
            styles = [_style(raw) for raw, row in lines if row is not None]
            batch = values(found)
            ends = [b""] * len(found)
            for addition in additions:
                signals = {signal: batch[name] for signal, name in addition.signals.items()}
                after = addition.correct(batch[addition.column], signals)
                for i, value in enumerate(after.tolist()):
                    if value == value:
                        between, sign = styles[i]
                        name = addition.added.encode()
                        ends[i] += between + name + sign + repr(value).encode()
            made = iter(ends)
            parts = []
            for raw, row in lines:
                body = raw.rstrip(b"\r\n \t,;")
                parts.append(raw if row is None else body + next(made) + raw[len(body) :])
            data = b"".join(parts)
            output.write(data)
            check = zlib.crc32(data, check)
            rows += len(found)
            task.watch(len(found), file.part)
    return Contents(rows, {"bytes": f"{check:08x}"})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksum of the bytes as they read back."""
    rows = sum(row is not None for _raw, row in _lines(path))
    check = 0
    with open_text(path) as file:
        while data := file.read(1 << 20):
            check = zlib.crc32(data, check)
    return Contents(rows, {"bytes": f"{check:08x}"})


def _clocked(names: Sequence[str]) -> Callable[[list[_Row]], Batch]:
    """What makes columns of rows; the clock of a terminal begins again at midnight."""
    days, last = 0.0, -np.inf

    def time(row: _Row) -> float:
        nonlocal days, last
        if _TIME in row.values or row.clock is None:
            return row.values.get(_TIME, np.nan)
        if row.clock + days < last - _DAY / 2.0:
            days += _DAY
        last = row.clock + days
        return last

    def values(rows: list[_Row]) -> Batch:
        return {
            name: np.array(
                [time(row) if name == _TIME else row.values.get(name, np.nan) for row in rows]
            )
            for name in dict.fromkeys(names)
        }

    return values


def _style(raw: bytes) -> tuple[bytes, bytes]:
    """The separators between the pairs of a line, and within a pair."""
    pairs = list(PAIR.finditer(raw))
    between = raw[pairs[0].end() : pairs[1].start()] if len(pairs) > 1 else b","
    return between, raw[pairs[0].end(1) : pairs[0].start(2)]


def _blocks(path: Path, opened: TextFile) -> Iterator[list[tuple[bytes, _Row | None]]]:
    block: list[tuple[bytes, _Row | None]] = []
    for entry in _lines(path, opened):
        block.append(entry)
        if len(block) == _BLOCK:
            yield block
            block = []
    if block:
        yield block


def _lines(path: Path, opened: TextFile | None = None) -> Iterator[tuple[bytes, _Row | None]]:
    """Every line with its row, None for words, of a file that may be open already.

    Raises
    ------
    FileError
        A line begins with the name that rows begin with and is none.
    """
    first: bytes | None = None
    with opened or open_text(path) as file:
        number = 0
        while raw := file.readline(1 << 16):
            number += 1
            clock = _CLOCK.match(raw)
            text = raw[clock.end() :] if clock else raw
            pairs = PAIR.findall(text)
            row = None
            if pairs and not PAIR.sub(b"", text).strip(_BETWEEN + b"\r\n"):
                values = {name.decode("utf-8", "replace"): float(x) for name, x in pairs}
                row = _Row(values, _seconds(clock), number)
                first = first or pairs[0][0]
            elif (
                first
                and re.match(rb"\s*%s\s*[:=]" % re.escape(first), text)
                and raw.endswith(b"\n")  # else the log was ended within a line
            ):
                got = text.decode("utf-8", "replace").strip()[:60]
                problem = f"names and numbers are needed, got {got!r}"
                raise FileError(path, problem, line=number)
            yield raw, row


def _seconds(clock: re.Match[bytes] | None) -> float | None:
    if clock is None:
        return None
    hours, minutes, seconds = (float(part) for part in clock.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds
