"""Rows of CSV text in quoted blocks with the lines they came from, by the standard library."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .csvcells import LONGEST_LINE, cell_number, cut_rows, is_comment, not_cut, western_text
from .csvheader import Header
from .format import Labels, row_labels

#: Numbers in lines, all without an exponent.
_PLAIN = re.compile(r"-?\d+(?:\.\d+)?(?:\n-?\d+(?:\.\d+)?)*", re.ASCII)

#: Bytes taken together.
BLOCK = 1 << 21


class QuotedBlock:
    """Rows cut by the standard library, with the text they were cut from."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.texts: list[str] = []
        self.cells: list[list[str]] = []
        self.lines: list[int] = []
        #: Lines that hold no readings: their numbers and words.
        self.messages: list[tuple[int, str]] = []

    @classmethod
    def whole(cls, data: bytes, header: Header, line: int) -> QuotedBlock:
        """All of ``data``, which ends with a row, in one block."""
        block = cls(header)
        for part in quoted_blocks(data, io.BytesIO(), header, line):
            block.texts += part.texts
            block.cells += part.cells
            block.lines += part.lines
            block.messages += part.messages
        return block

    @property
    def rows(self) -> int:
        """Rows with cells; blank lines are kept but are no rows."""
        return len(self.lines)

    @property
    def data(self) -> bytes:
        """The text of the block."""
        return "".join(self.texts).encode(errors="surrogateescape")

    def numbers(
        self, names: Sequence[str], texts: Sequence[str] = (), strict: bool = False
    ) -> dict[str, NDArray[np.float64]]:
        """Columns as numbers, empty cells as NaN; ``texts`` are at hand anyway.

        With ``strict`` words for what is no finite number are refused.
        """
        return {name: self._numbers(name, strict) for name in names}

    def _numbers(self, name: str, strict: bool) -> NDArray[np.float64]:
        place = self.header.names.index(name)
        cells = [row[place].strip() for row in self.cells if row]
        values = _plain_numbers(cells)
        if values is not None:
            return values
        values = np.full(len(cells), np.nan)
        for i, cell in enumerate(cells):
            if not cell:
                continue
            value = cell_number(cell, self.header.decimal)
            if value is None:
                again = cell == name.partition(" [")[0]
                hint = "; the names are repeated there: give the files one by one" if again else ""
                raise self._refused(i, name, f"a number is needed, got {_shown(cell)}{hint}")
            if strict and not np.isfinite(value):
                problem = f"readings must be finite, got {_shown(cell)}; drop the row"
                raise self._refused(i, name, problem)
            values[i] = value
        return values

    def _refused(self, row: int, column: str, problem: str) -> FileError:
        return FileError(self.header.path, problem, line=self.lines[row], column=column)

    def labels(self, name: str) -> Labels:
        """A column of texts, empty ones as None."""
        place = self.header.names.index(name)
        return row_labels([western_text(row[place].strip()) or None for row in self.cells if row])

    def with_columns(self, columns: Sequence[tuple[str, NDArray[Any]]]) -> bytes:
        """The text with a value added to every row; empty where the angle's cell is."""
        header = self.header
        ends = [[repr(value) for value in values.tolist()] for _name, values in columns]
        if header.decimal == ",":
            ends = [[value.replace(".", ",") for value in values] for values in ends]
        places = [header.names.index(name) for name, _values in columns]
        lines = []
        row_number = 0
        for text, row in zip(self.texts, self.cells, strict=True):
            if not row:
                lines.append(self._kept(text, len(header.names) + len(columns)))
                continue
            body = text.rstrip("\r\n")
            ending = text[len(body) :] or header.ending
            values = [
                end[row_number] if row[place].strip() else ""
                for end, place in zip(ends, places, strict=True)
            ]
            # The line ends with a delimiter.
            if len(row) > len(header.names) and header.delimiter != " ":
                body = body.rstrip()[: -len(header.delimiter)]
            lines.append(header.delimiter.join([body, *values]) + ending)
            row_number += 1
        return "".join(lines).encode(errors="surrogateescape")

    def _kept(self, text: str, width: int) -> str:
        """A line without readings, which is none among more columns either."""
        delimiter = self.header.delimiter
        if is_comment(text) or len(next(cut_rows([text], delimiter), [])) != width:
            return text
        body = text.rstrip("\r\n")
        return body + delimiter + text[len(body) :]


def _plain_numbers(cells: list[str]) -> NDArray[np.float64] | None:
    """Cells that hold nothing but digits and a point, as most do; None where one does not."""
    joined = "\n".join(cells)
    # A quoted cell may hold lines of its own.
    if joined.count("\n") >= len(cells) or not _PLAIN.fullmatch(joined):
        return None
    values = np.fromiter(map(float, cells), np.float64, len(cells))
    return values if np.isfinite(values).all() else None


def _shown(cell: str) -> str:
    return repr(cell) if len(cell) <= 60 else f"{cell[:50]!r} ... of {len(cell)} characters"


def line_too_long(header: Header, line: int) -> FileError:
    """The error of a line that memory must not follow."""
    return FileError(
        header.path, f"is longer than {LONGEST_LINE >> 20} MiB; is this a table?", line=line
    )


def quoted_blocks(data: bytes, file: IO[bytes], header: Header, line: int) -> Iterator[QuotedBlock]:
    """``data`` and the remainder of ``file`` in blocks of whole rows; ``line`` is its first."""
    read: list[str] = []
    block = QuotedBlock(header)
    size, width = 0, len(header.names)
    reached = line - 1  # the line read last

    def lines() -> Iterator[str]:
        nonlocal reached
        for raw in _lines(data, file, header, line):
            reached += 1
            text = raw.decode(errors="surrogateescape")  # other columns stay as they are
            if not read and is_comment(text):
                block.texts.append(text)
                block.cells.append([])
                continue
            read.append(text)
            yield text

    reader = cut_rows(lines(), header.delimiter, strict=True)
    try:
        for row in reader:
            first = reached + 1 - len(read)
            blank = len(row) <= 1 and not any(cell.strip() for cell in row)
            cells = [] if blank else row
            text = "".join(read)
            if cells and header.is_message(cells):
                block.messages.append((first, text.strip()))
                cells = []
            if cells and len(cells) != width and not _fits(cells, width):
                raise _wrong_width(header, len(cells), first)
            read.clear()
            block.texts.append(text)
            block.cells.append(cells)
            if cells:
                block.lines.append(first)
            size += len(text)
            if size >= BLOCK:
                done, block, size = block, QuotedBlock(header), 0
                yield done
    except csv.Error as cause:
        raise not_cut(header.path, cause, max(reached, line)) from None
    if block.texts:
        yield block


def _fits(row: list[str], width: int) -> bool:
    """One cell more than there are names, where the line ends with a delimiter."""
    return len(row) == width + 1 and not row[-1].strip()


def _lines(data: bytes, file: IO[bytes], header: Header, line: int) -> Iterator[bytes]:
    """Lines of ``data`` and of the file after it."""
    while True:
        parts = data.split(b"\n")
        for part in parts[:-1]:
            line += 1
            yield part + b"\n"
        data = file.read(BLOCK)
        if not data:
            if parts[-1]:
                yield parts[-1]
            return
        if len(parts[-1]) > LONGEST_LINE:
            raise line_too_long(header, line)
        data = parts[-1] + data


def _wrong_width(header: Header, width: int, line: int) -> FileError:
    return FileError(
        header.path,
        f"{width} value{'s'[: width != 1]} where the header has {len(header.names)} columns; "
        "correct or delete the row",
        line=line,
    )
