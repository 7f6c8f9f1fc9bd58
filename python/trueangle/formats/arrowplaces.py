"""Where an Arrow file keeps columns of numbers as they are, to be read without mapped memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import FileIO
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .arrowmessages import Block, Footer, batch_message
from .arrowtables import dtype_of
from .stored import ROWS, stored_values

__all__ = ["PlacedBatch", "placed_batch"]


class Place(NamedTuple):
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
    places: dict[str, Place]

    def read(self, file: FileIO, part: int, parts: int) -> Iterator[dict[str, NDArray[Any]]]:
        """One of so many parts of the rows, in blocks."""
        first, last = (self.rows * k // parts for k in (part, part + 1))
        for start in range(first, last, ROWS):
            stop = min(start + ROWS, last)
            yield {name: place.read(file, start, stop) for name, place in self.places.items()}


def placed_batch(
    file: FileIO, footer: Footer, block: Block, schema: pa.Schema, names: Sequence[str]
) -> PlacedBatch | None:
    """Where columns lie; None where pyarrow has to look at them: packed, texts, within others.

    Raises
    ------
    ValueError, struct.error
        The batch is damaged.
    """
    counts = [count for field in schema if (count := _buffers(field.type)) is not None]
    wanted = {name: schema.get_field_index(name) for name in names}
    plain = footer.is_little_endian and len(counts) == len(schema)
    if not plain or any(i < 0 or not _is_number(schema.field(i).type) for i in wanted.values()):
        return None
    found = batch_message(file, block)
    if found.codec is not None:
        return None
    starts = np.cumsum([0, *counts]).tolist()
    if (len(found.nodes), len(found.buffers)) != (len(counts), starts[-1]):
        raise ValueError("a record batch has other columns than its schema")
    places = {}
    for name, index in wanted.items():
        dtype = dtype_of(schema.field(index).type).newbyteorder("<")
        rows, nulls = found.nodes[index]
        bits, values = found.buffers[starts[index] :][:2]
        held = min(values[1] // dtype.itemsize, 8 * bits[1] if nulls else rows)
        if not 0 <= rows == found.rows <= held:
            raise ValueError(f"column {name} holds fewer values than its record batch")
        places[name] = Place(dtype, values[0], bits[0] if nulls else None)
    return PlacedBatch(found.rows, places)


def _buffers(kind: pa.DataType) -> int | None:
    """Buffers of a column, None where they are not of the column alone."""
    types = pa.types
    if types.is_null(kind):
        return 0
    if types.is_primitive(kind) or types.is_decimal(kind) or types.is_dictionary(kind):
        return 2
    if types.is_string(kind) or types.is_large_string(kind):
        return 3
    return None


def _is_number(kind: pa.DataType) -> bool:
    types = pa.types
    return bool(types.is_integer(kind) or types.is_float32(kind) or types.is_float64(kind))
