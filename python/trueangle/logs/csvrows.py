"""Rows of CSV text with the lines they came from, cut by the standard library."""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .formats import Labels

__all__ = ["BLOCK", "Header", "QuotedBlock", "quoted_blocks"]

#: Bytes taken together.
BLOCK = 1 << 22


class Header:
    """First line of a log: its text, delimiter, line ending and column names."""

    def __init__(self, path: Path, line: bytes) -> None:
        self.path = path
        try:
            text = line.removeprefix(codecs.BOM_UTF8).decode()
        except UnicodeDecodeError:
            raise FileError(path, "is not UTF-8 text; save it as CSV in UTF-8", line=1) from None
        if not text.strip():
            raise FileError(path, "is empty; a header line is needed", line=1)
        self.mark = codecs.BOM_UTF8 if line.startswith(codecs.BOM_UTF8) else b""
        self.ending = "\r\n" if text.endswith("\r\n") else "\n"
        self.text = text.rstrip("\r\n")
        self.delimiter = max(",;\t", key=self.text.count)
        cells = next(csv.reader([self.text], delimiter=self.delimiter))
        self.names = [name.strip() for name in cells]


class QuotedBlock:
    """Rows cut by the standard library, with the text they were cut from."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.texts: list[str] = []
        self.cells: list[list[str]] = []
        self.lines: list[int] = []

    @classmethod
    def whole(cls, data: bytes, header: Header, line: int) -> QuotedBlock:
        """All of ``data``, which ends with a row, in one block."""
        block = cls(header)
        for part in quoted_blocks(data, io.BytesIO(), header, line):
            block.texts += part.texts
            block.cells += part.cells
            block.lines += part.lines
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
        self, names: Sequence[str], texts: Sequence[str] = ()
    ) -> dict[str, NDArray[np.float64]]:
        """Columns as numbers, empty cells as NaN; ``texts`` are at hand anyway."""
        return {name: self._numbers(name) for name in names}

    def _numbers(self, name: str) -> NDArray[np.float64]:
        place = self.header.names.index(name)
        cells = [row[place].strip() for row in self.cells if row]
        try:
            return np.array([float(cell) if cell else np.nan for cell in cells])
        except ValueError:
            for line, cell in zip(self.lines, cells, strict=True):
                try:
                    float(cell or "nan")
                except ValueError:
                    raise FileError(
                        self.header.path,
                        f"a number is needed, got {cell!r}",
                        line=line,
                        column=name,
                    ) from None
            raise

    def labels(self, name: str) -> Labels:
        """A column of texts, empty ones as None."""
        place = self.header.names.index(name)
        codes: dict[str | None, int] = {}
        cells = [row[place].strip() or None for row in self.cells if row]
        found = [codes.setdefault(cell, len(codes)) for cell in cells]
        return Labels(np.array(found, dtype=np.intp), list(codes))

    def with_columns(self, columns: Sequence[tuple[str, NDArray[Any]]]) -> bytes:
        """The text with a value added to every row; empty where the angle's cell is."""
        ends = [[repr(value) for value in values.tolist()] for _name, values in columns]
        places = [self.header.names.index(name) for name, _values in columns]
        lines = []
        number = 0
        for text, row in zip(self.texts, self.cells, strict=True):
            if not row:
                lines.append(text)
                continue
            body = text.rstrip("\r\n")
            ending = text[len(body) :] or self.header.ending
            values = [
                end[number] if row[place].strip() else ""
                for end, place in zip(ends, places, strict=True)
            ]
            lines.append(self.header.delimiter.join([body, *values]) + ending)
            number += 1
        return "".join(lines).encode(errors="surrogateescape")


def quoted_blocks(data: bytes, file: IO[bytes], header: Header, line: int) -> Iterator[QuotedBlock]:
    """``data`` and the rest of ``file`` in blocks of whole rows; ``line`` is its first."""
    read: list[str] = []

    def lines() -> Iterator[str]:
        for raw in _lines(data, file):
            read.append(raw.decode(errors="surrogateescape"))  # other columns stay as they are
            yield read[-1]

    reader = csv.reader(lines(), delimiter=header.delimiter, strict=True)
    block = QuotedBlock(header)
    size = 0
    try:
        for row in reader:
            first = line + reader.line_num - len(read)
            if row and len(row) != len(header.names):
                raise _wrong_width(header, len(row), first)
            text = "".join(read)
            read.clear()
            block.texts.append(text)
            block.cells.append(row)
            if row:
                block.lines.append(first)
            size += len(text)
            if size >= BLOCK:
                yield block
                block, size = QuotedBlock(header), 0
    except csv.Error as cause:
        raise FileError(
            header.path, f"is not readable as CSV: {cause}", line=line + reader.line_num - 1
        ) from None
    if block.texts:
        yield block


def _lines(data: bytes, file: IO[bytes]) -> Iterator[bytes]:
    """Lines of ``data`` and of the file after it."""
    while True:
        parts = data.split(b"\n")
        for part in parts[:-1]:
            yield part + b"\n"
        data = file.read(BLOCK)
        if not data:
            if parts[-1]:
                yield parts[-1]
            return
        data = parts[-1] + data


def _wrong_width(header: Header, width: int, line: int) -> FileError:
    return FileError(
        header.path,
        f"{width} values where the header has {len(header.names)} columns",
        line=line,
    )
