"""Where an Arrow file keeps columns of numbers as they are, to be read without mapped memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import FileIO
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .arrowvalues import arrow_dtype
from .stored import ROWS, stored_values


class ColumnBuffers(NamedTuple):
    """Where the values of a column lie, and the bits that are 0 where one is null."""

    dtype: np.dtype[Any]
    values: int
    known: int | None

    def read(self, file: FileIO, start: int, stop: int) -> NDArray[Any]:
        """The rows from ``start`` to ``stop``, nulls as NaN."""
        place = self.values + start * self.dtype.itemsize
        values = stored_values(file, place, self.dtype, stop - start)
        if self.known is None:
            return values
        first = start // 8
        bits = stored_values(file, self.known + first, np.uint8, -(-stop // 8) - first)
        known = np.unpackbits(bits, bitorder="little")[start - 8 * first :][: stop - start]
        if values.dtype.kind != "f":
            values = values.astype(np.float64)
        values[known == 0] = np.nan
        return values


class PlacedBatch(NamedTuple):
    """Some columns of a record batch."""

    rows: int
    places: dict[str, ColumnBuffers]

    def read(self, file: FileIO, part: int, parts: int) -> Iterator[dict[str, NDArray[Any]]]:
        """One of so many parts of the rows, in blocks."""
        first, last = (self.rows * k // parts for k in (part, part + 1))
        for start in range(first, last, ROWS):
            stop = min(start + ROWS, last)
            yield {name: place.read(file, start, stop) for name, place in self.places.items()}


def placed_batch(
    mapped: pa.MemoryMappedFile, batch: pa.RecordBatch, names: Sequence[str]
) -> PlacedBatch | None:
    """Where columns of a batch of a mapped file lie, by the addresses that pyarrow gives them.

    None where pyarrow has to look at them: packed, turned to another byte order, not numbers.
    Of what is mapped nothing is read but what describes the batch.
    """
    size, rows = mapped.size(), batch.num_rows
    mapped.seek(0)
    base = mapped.read_buffer(1).address  # of more, the system would look at every page

    def place(part: pa.Buffer | None, least: int) -> int | None:
        """The byte of the file that a part of so many bytes starts at."""
        if part is None or part.size < least:
            return None
        start = part.address - base
        return start if 0 <= start <= size - part.size else None

    places = {}
    for name in names:
        # A name that is there twice has no index.
        if batch.schema.get_field_index(name) < 0 or not _is_number(batch[name].type):
            return None
        column = batch[name]
        dtype, (known, values) = arrow_dtype(column.type), column.buffers()
        at = place(values, rows * dtype.itemsize)
        bits = place(known, -(-rows // 8)) if column.null_count else None
        if column.offset or at is None or (column.null_count and bits is None):
            return None
        places[name] = ColumnBuffers(dtype, at, bits)
    return PlacedBatch(rows, places)


def _is_number(kind: pa.DataType) -> bool:
    types = pa.types
    return bool(types.is_integer(kind) or types.is_float32(kind) or types.is_float64(kind))
