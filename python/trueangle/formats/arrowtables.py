"""Arrow data: names, elements, labels, numpy arrays, corrected columns added, checksums."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ..errors import FileError
from .format import Addition, Batch, Contents, Labels, Selection, decoded_text, note
from .stored import Checksum

#: Key of the schema's metadata under which the provenance is kept.
METADATA_KEY = b"trueangle"
#: An element of a column of lists, and how many of them are columns, at most.
_ELEMENT = re.compile(r"(.+)\[(\d+)\]", re.DOTALL)


def element_names(schema: pa.Schema, first: Callable[[str], int]) -> list[str]:
    """Columns of numbers and texts, elements of columns of lists as ``state[3]``.

    ``first`` returns the length of the first list of a column whose lists may differ in length.
    """
    found: list[str] = []
    for field in schema:
        kind = field.type
        if is_number(kind) or is_label(kind):
            found.append(field.name)
        elif not is_list(kind):  # structures, bytes: nothing that could be read
            continue
        elif pa.types.is_integer(kind.value_type) or pa.types.is_floating(kind.value_type):
            fixed = pa.types.is_fixed_size_list(kind)
            size = kind.list_size if fixed else first(field.name)
            found += [f"{field.name}[{i}]" for i in range(min(size, 256))]
    return found


def other_names(schema: pa.Schema) -> list[str]:
    """Columns that hold neither numbers nor texts."""
    return [field.name for field in schema if not (is_number(field.type) or is_label(field.type))]


def top_names(schema: pa.Schema, names: Iterable[str]) -> list[str]:
    """The columns that hold some columns and elements, each once."""
    return list(dict.fromkeys(_top(schema, name)[0] for name in names))


def _taken_column(table: Any, name: str) -> Any:
    """A column of a table or record batch, or an element of one of lists.

    Raises
    ------
    pyarrow.ArrowInvalid
        A list is too short.
    """
    top, element = _top(table.schema, name)
    return table[top] if element is None else pc.list_element(table[top], element)


def _top(schema: pa.Schema, name: str) -> tuple[str, int | None]:
    found = None if name in schema.names else _ELEMENT.fullmatch(name)
    return (name, None) if found is None else (found[1], int(found[2]))


def corrected_schema(schema: pa.Schema, channels: Sequence[Addition], path: object) -> pa.Schema:
    """``schema`` with the corrected columns and the note of how they were made."""
    for channel in channels:
        top, element = _top(schema, channel.column)
        kind = schema.field(top).type
        if element is not None:
            kind = kind.value_type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        single = pa.types.is_float16(kind) or pa.types.is_float32(kind)
        schema = schema.append(pa.field(channel.added, pa.float32() if single else pa.float64()))
    return schema.with_metadata({**(schema.metadata or {}), METADATA_KEY: note(channels).encode()})


def add_corrected(path: object, table: Any, channels: Sequence[Addition], schema: pa.Schema) -> Any:
    """A table or record batch with the corrected column of every channel.

    Nulls stay null, NaN stays NaN; the other columns are not touched.
    """
    columns = list(table.columns)
    for channel in channels:
        column = _taken_column(table, channel.column)
        signals = {
            signal: arrow_numbers(path, name, _taken_column(table, name))
            for signal, name in channel.signals.items()
        }
        corrected = channel.correct(arrow_numbers(path, channel.column, column), signals)
        missing = None
        if column.null_count:
            missing = np.asarray(column.is_null().to_numpy(zero_copy_only=False))
        columns.append(pa.array(corrected, mask=missing))
    return type(table).from_arrays(columns, schema=schema)


class ArrowDigest:
    """Checksums of every column of tables or batches, however they were cut."""

    def __init__(self) -> None:
        self.rows = 0
        self._sums: dict[str, Checksum | int] = {}

    def update(self, table: Any) -> None:
        """Take in the next rows."""
        self.rows += table.num_rows
        for name, column in zip(table.schema.names, table.columns, strict=True):
            chunks = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
            for chunk in chunks:
                self._column(name, chunk)

    def passed(self, tables: Iterable[Any]) -> Iterator[Any]:
        """The same tables, taken in on their way."""
        for table in tables:
            self.update(table)
            yield table

    def contents(self) -> Contents:
        """Rows and checksums so far."""
        return Contents(
            self.rows,
            {
                name: f"{found:08x}" if isinstance(found, int) else found.text()
                for name, found in self._sums.items()
            },
        )

    def _column(self, name: str, column: pa.Array) -> None:
        nulls = self._sums.setdefault(f"{name}:null", Checksum())
        assert isinstance(nulls, Checksum)
        if column.null_count:
            nulls.update(column.is_null().cast(pa.uint8()).to_numpy())
            column = column.drop_null()  # what lies under a null means nothing
        else:
            nulls.count += len(column)  # zeros
        kind = column.type
        if isinstance(column, pa.ExtensionArray):
            self._column(name, column.storage)
        elif pa.types.is_dictionary(kind):
            self._column(name, column.dictionary_decode())
        elif pa.types.is_run_end_encoded(kind):
            self._column(name, pc.run_end_decode(column))
        elif pa.types.is_struct(kind):
            for i, child in enumerate(column.flatten()):
                self._column(f"{name}.{kind.field(i).name}", child)
        elif pa.types.is_map(kind):
            pairs = pa.struct([("key", kind.key_type), ("value", kind.item_type)])
            self._column(name, column.cast(pa.list_(pairs)))
        elif is_list(kind):
            lengths = pc.list_value_length(column)
            self._words(f"{name}:length", lengths.cast(pa.int64()).to_numpy())
            self._column(f"{name}[]", column.flatten())
        elif is_text(kind):
            self._text(name, column)
        elif pa.types.is_boolean(kind):
            self._words(name, column.cast(pa.uint8()).to_numpy())
        elif not pa.types.is_null(kind):
            width = kind.bit_width // 8
            data = np.frombuffer(column.buffers()[1] or b"", dtype=np.uint8)
            data = data[column.offset * width : (column.offset + len(column)) * width]
            word = 8 if width % 8 == 0 else width if width in (2, 4) else 1
            self._words(name, data.view(f"u{word}"))

    def _text(self, name: str, column: pa.Array) -> None:
        large = pa.large_binary()
        if is_string(column.type):
            column = column.cast(pa.large_string())
        column = column.cast(large)
        self._words(f"{name}:length", pc.binary_length(column).to_numpy())
        if len(column):
            offsets = np.frombuffer(column.buffers()[1], dtype=np.int64)[column.offset :]
            data = memoryview(column.buffers()[2] or b"")[offsets[0] : offsets[len(column)]]
            before = self._sums.get(name, 0)
            assert isinstance(before, int)
            self._sums[name] = zlib.crc32(data, before)

    def _words(self, name: str, values: NDArray[Any]) -> None:
        found = self._sums.setdefault(name, Checksum())
        assert isinstance(found, Checksum)
        found.update(values)


def column_batches(path: object, batches: Iterable[Any], wanted: Selection) -> Iterator[Batch]:
    """The selected columns of record batches: numbers as arrays, selected texts as labels."""
    for batch in batches:
        yield {
            name: _values(path, name, _taken_column(batch, name), name in wanted.texts)
            for name in wanted.names
        }


def _values(path: object, name: str, column: Any, as_text: bool) -> Any:
    if as_text and pa.types.is_timestamp(column.type):
        column = column.cast(pa.string())
    return label_codes(column) if is_label(column.type) else arrow_numbers(path, name, column)


#: Times count from 2000: a later start keeps more digits of a second.
_STAMP, _EPOCH = pa.timestamp("us"), 946684800.0
_PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_WHOLE = {32: pa.int32(), 64: pa.int64()}


def arrow_numbers(path: object, name: str, column: pa.Array | pa.ChunkedArray) -> NDArray[Any]:
    """A column as an array without a copy where it has no nulls; nulls become NaN.

    Raises
    ------
    FileError
        The column holds neither numbers nor times, which are seconds: since 2000, of a day, or of
        a duration.
    """
    if isinstance(column, pa.ChunkedArray):
        column = column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()
    if isinstance(column, pa.ChunkedArray):  # an empty one stays chunked in some versions
        column = pa.array([], column.type)
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.dictionary_decode()
        kind = column.type
    if pa.types.is_float16(kind):
        column = column.cast(pa.float32())
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return arrow_values(column.cast(_STAMP).cast(pa.int64())) * 1e-6 - _EPOCH
    elif pa.types.is_duration(kind) or pa.types.is_time(kind):
        return arrow_values(column.cast(_WHOLE[kind.bit_width])) / _PER_SECOND[kind.unit]
    elif pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise FileError(path, f"numbers are needed, the column holds {kind}", column=name)
    return arrow_values(column)


def arrow_dtype(kind: pa.DataType) -> np.dtype[Any]:
    """What numpy calls whole numbers or floats of Arrow."""
    letter = "f" if pa.types.is_floating(kind) else "iu"[pa.types.is_unsigned_integer(kind)]
    return np.dtype(f"{letter}{kind.bit_width // 8}")


def arrow_values(column: pa.Array) -> NDArray[Any]:
    """Whole numbers or floats as `pyarrow.Array.to_numpy` gives them, nulls as NaN.

    That method imports pandas where it is installed, which takes longer than a million numbers.
    """
    data, dtype = column.buffers()[1], arrow_dtype(column.type)
    if data is None:  # nothing, or nulls alone
        values: NDArray[Any] = np.zeros(len(column), dtype)
    else:
        values = np.frombuffer(data, dtype, len(column), column.offset * dtype.itemsize)
    if column.null_count:
        missing = column.is_null().cast(pa.uint8()).buffers()[1]
        values = values.astype(dtype if dtype.kind == "f" else np.float64)
        values[np.frombuffer(missing, np.bool_, len(column))] = np.nan
    return values


def label_codes(column: pa.Array | pa.ChunkedArray) -> Labels:
    """A column of texts by their place among the different ones; nulls are the last."""
    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    if pa.types.is_string_view(column.type) or pa.types.is_binary_view(column.type):
        column = column.cast(pa.large_binary())
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    names = [decoded_text(name) for name in column.dictionary.to_pylist()]
    codes = arrow_values(column.indices)
    if column.indices.null_count:
        codes = np.where(np.isnan(codes), len(names), codes)
    codes = codes.astype(np.intp)
    if codes.size and not 0 <= int(codes.min()) <= int(codes.max()) <= len(names):
        raise pa.ArrowInvalid("indices beyond their dictionary")
    return Labels(codes, [*names, None])


def is_number(kind: pa.DataType) -> bool:
    """Whether `arrow_numbers` takes it."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    plain = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)
    in_time = pa.types.is_temporal(kind) and not pa.types.is_interval(kind)
    return bool(plain or in_time or pa.types.is_boolean(kind) or pa.types.is_null(kind))


def is_label(kind: pa.DataType) -> bool:
    """Whether `label_codes` takes it: text, or the bytes of one."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return is_text(kind) or bool(pa.types.is_fixed_size_binary(kind))


def is_string(kind: pa.DataType) -> bool:
    """Whether it is text, however it is laid out."""
    return bool(
        pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    )


def is_text(kind: pa.DataType) -> bool:
    """Whether it is text or bytes of any length."""
    return is_string(kind) or bool(
        pa.types.is_binary(kind) or pa.types.is_large_binary(kind) or pa.types.is_binary_view(kind)
    )


def is_list(kind: pa.DataType) -> bool:
    """Whether its values are lists of values."""
    return bool(
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    )
