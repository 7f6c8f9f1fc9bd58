"""Blocks of CSV lines without quotes, read and written by pyarrow at memory speed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from .arrowtables import arrow_numbers, label_codes
from .csvheader import Header
from .csvrows import QuotedBlock
from .format import Labels

_NEWLINE, _NOTE, _END = b"\n#E"


def plain_block(data: bytes, header: Header, line: int) -> PlainBlock | None:
    """The block, or None for text that needs the standard library: blank lines, notes."""
    if header.trailing:
        return None
    columns = len(header.names)
    if header.delimiter == " ":
        parsed = _without_blanks(data)
    elif data.count(header.delimiter.encode()) == (columns - 1) * _lines(data):
        parsed = data
    else:
        return None
    width = len(header.ending)
    signs = np.frombuffer(data, dtype=np.uint8)
    is_end = signs == _NEWLINE
    rows = _lines(data)
    # Looking whether a sign is there at all takes a fraction of looking where.
    if (b"\r" in data) is (width == 1):
        return None
    if width == 2 and not data.count(b"\r") == data.count(b"\n") == data.count(b"\r\n"):
        return None
    if is_end[width - 1] or (is_end[width:] & is_end[:-width]).any():
        return None
    block = PlainBlock(data, parsed, header, line, rows)
    if b"#" in data or b"F" in data:
        first = signs[block.starts]
        if (first == _NOTE).any() or ((first == _END).any() and _has_end(data)):
            return None
    return block


def _lines(data: bytes) -> int:
    return data.count(b"\n") + (not data.endswith(b"\n"))


def _without_blanks(data: bytes) -> bytes:
    """Columns that blanks separate, with one blank between them and exponents written with e."""
    data = re.sub(rb"[ \t]+", b" ", data)
    data = data.replace(b"\n ", b"\n").replace(b" \n", b"\n").replace(b" \r\n", b"\r\n").strip(b" ")
    return re.sub(rb"(?<=[\d.])[dD](?=[+-]\d)", b"e", data) if b"D" in data else data


def _has_end(data: bytes) -> bool:
    return data.startswith(b"EOF") or b"\nEOF" in data


class PlainBlock:
    """Lines of text without quotes, every one a row."""

    def __init__(self, data: bytes, parsed: bytes, header: Header, line: int, rows: int) -> None:
        self.data = data
        self._parsed = parsed
        self.header = header
        self.line = line
        #: Number of lines.
        self.rows = rows
        self._table: pa.Table = None
        self._quoted: QuotedBlock | None = None

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Place of the first sign of every line."""
        ends = np.flatnonzero(np.frombuffer(self.data, dtype=np.uint8) == _NEWLINE)
        starts = np.concatenate([[0], ends + 1])
        return starts[:-1] if starts[-1] == len(self.data) else starts

    @property
    def lines(self) -> range:
        """Number of the line of every row."""
        return range(self.line, self.line + self.rows)

    def numbers(
        self, names: Sequence[str], texts: Sequence[str] = (), strict: bool = False
    ) -> dict[str, NDArray[np.float64]]:
        """Columns as numbers, empty cells as NaN; see `QuotedBlock.numbers`.

        Columns ``texts`` are cut out on the way, for `labels`.
        """
        try:
            self._table = pa.csv.read_csv(
                pa.BufferReader(_owned_by_arrow(self._parsed)),
                pa.csv.ReadOptions(column_names=self.header.names),
                pa.csv.ParseOptions(delimiter=self.header.delimiter, quote_char=False),
                pa.csv.ConvertOptions(
                    include_columns=[*names, *texts],
                    column_types=dict.fromkeys(names, pa.float64())
                    | dict.fromkeys(texts, pa.dictionary(pa.int32(), pa.string())),
                    null_values=[""],
                    decimal_point=self.header.decimal,
                ),
            )
            if self._table.num_rows != self.rows:
                raise pa.ArrowInvalid("rows and lines differ")
            if strict and not all(_is_finite(self._table[name]) for name in names):
                raise pa.ArrowInvalid("words instead of numbers")
        except pa.ArrowInvalid:
            # The standard library reads a little more (+1.5) and reports what is wrong where.
            self._quoted = QuotedBlock.whole(self.data, self.header, self.line)
            return self._quoted.numbers(names, texts, strict)
        return {name: arrow_numbers(self.header.path, name, self._table[name]) for name in names}

    @property
    def messages(self) -> list[tuple[int, str]]:
        """Lines that hold no readings, after `numbers`; see `QuotedBlock.messages`."""
        return [] if self._quoted is None else self._quoted.messages

    def labels(self, name: str) -> Labels:
        """A column of texts after `numbers`; see `QuotedBlock.labels`."""
        if self._quoted is not None:
            return self._quoted.labels(name)
        codes, names = label_codes(self._table[name])
        return Labels(codes, [(text or "").strip() or None for text in names])

    def with_columns(self, columns: Sequence[tuple[str, NDArray[Any]]]) -> bytes:
        """The text with a value added to every line; see `QuotedBlock.with_columns`."""
        if self._quoted is not None:
            return self._quoted.with_columns(columns)
        offsets = np.append(self.starts, len(self.data)).astype(np.int64)
        lines = pa.Array.from_buffers(
            pa.large_string(), self.rows, [None, pa.py_buffer(offsets), pa.py_buffer(self.data)]
        )
        parts = [pc.ascii_rtrim(lines, "\r\n")]
        for name, values in columns:
            empty = np.asarray(self._table[name].is_null().combine_chunks())
            told = pa.array(values, mask=empty).cast(pa.large_string())
            if self.header.decimal == ",":
                told = pc.replace_substring(told, ".", ",")
            parts.append(told)
        *bodies, last = parts
        joined = pc.binary_join_element_wise(
            *bodies,
            pc.binary_join_element_wise(
                last,
                pa.scalar(self.header.ending, pa.large_string()),
                pa.scalar("", pa.large_string()),
                null_handling="replace",
            ),
            pa.scalar(self.header.delimiter, pa.large_string()),
            null_handling="replace",
        )
        ends = np.frombuffer(joined.buffers()[1], dtype=np.int64)
        return memoryview(joined.buffers()[2])[: ends[len(joined)]].tobytes()


def _owned_by_arrow(data: bytes) -> pa.Buffer:
    """A copy that Arrow frees by itself.

    Its threads may let go of the text a moment after the table is made. If it is Python's they
    wait for the interpreter then, and where that is ending, the process is aborted.
    """
    copy = pa.allocate_buffer(len(data))
    memoryview(copy).cast("B")[:] = data
    return copy


def _is_finite(column: pa.ChunkedArray) -> bool:
    """True where every cell that is not empty holds a finite number."""
    return not pc.any(pc.invert(pc.is_finite(column))).as_py()
