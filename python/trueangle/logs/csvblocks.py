"""Blocks of CSV lines without quotes, read and written by pyarrow at memory speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from .arrowtables import labels
from .csvrows import Header, QuotedBlock
from .formats import Labels

__all__ = ["PlainBlock", "plain_block"]

_NEWLINE = 10


def plain_block(data: bytes, header: Header, line: int) -> PlainBlock | None:
    """The block, or None for text that needs the standard library: blank or mixed lines."""
    ends = np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == _NEWLINE)
    width = len(header.ending)
    starts = np.concatenate([[0], ends + 1])
    if starts[-1] == len(data):
        starts = starts[:-1]
    lengths = np.diff(starts, append=len(data))
    returns = data.count(b"\r")
    if (width == 1 and returns) or (width == 2 and not returns == ends.size == data.count(b"\r\n")):
        return None
    if lengths.size and lengths.min() <= width:
        return None
    return PlainBlock(data, header, line, starts)


class PlainBlock:
    """Lines of text without quotes, every one a row."""

    def __init__(self, data: bytes, header: Header, line: int, starts: NDArray[np.int64]) -> None:
        self.data = data
        self.header = header
        self.line = line
        self._starts = starts
        self._table: pa.Table = None
        self._quoted: QuotedBlock | None = None

    @property
    def rows(self) -> int:
        """Number of lines."""
        return int(self._starts.size)

    def numbers(
        self, names: Sequence[str], texts: Sequence[str] = ()
    ) -> dict[str, NDArray[np.float64]]:
        """Columns as numbers, empty cells as NaN; see `QuotedBlock.numbers`.

        Columns ``texts`` are cut out on the way, for `labels`.
        """
        try:
            self._table = pa.csv.read_csv(
                pa.BufferReader(self.data),
                pa.csv.ReadOptions(column_names=self.header.names),
                pa.csv.ParseOptions(delimiter=self.header.delimiter, quote_char=False),
                pa.csv.ConvertOptions(
                    include_columns=[*names, *texts],
                    column_types=dict.fromkeys(names, pa.float64())
                    | dict.fromkeys(texts, pa.dictionary(pa.int32(), pa.string())),
                    null_values=[""],
                ),
            )
            if self._table.num_rows != self.rows:
                raise pa.ArrowInvalid("rows and lines differ")
        except pa.ArrowInvalid:
            # The standard library reads a little more (+1.5) and says what is wrong where.
            self._quoted = QuotedBlock.whole(self.data, self.header, self.line)
            return self._quoted.numbers(names)
        return {name: self._table[name].to_numpy() for name in names}

    def labels(self, name: str) -> Labels:
        """A column of texts after `numbers`; see `QuotedBlock.labels`."""
        if self._quoted is not None:
            return self._quoted.labels(name)
        codes, names = labels(self._table[name])
        return Labels(codes, [(text or "").strip() or None for text in names])

    def with_columns(self, columns: Sequence[tuple[str, NDArray[Any]]]) -> bytes:
        """The text with a value added to every line; see `QuotedBlock.with_columns`."""
        if self._quoted is not None:
            return self._quoted.with_columns(columns)
        offsets = np.append(self._starts, len(self.data)).astype(np.int64)
        lines = pa.Array.from_buffers(
            pa.large_string(), self.rows, [None, pa.py_buffer(offsets), pa.py_buffer(self.data)]
        )
        parts = [pc.ascii_rtrim(lines, "\r\n")]
        for name, values in columns:
            empty = np.asarray(self._table[name].is_null().combine_chunks())
            parts.append(pa.array(values, mask=empty).cast(pa.large_string()))
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
