"""Columns of Arrow as arrays: numbers and times as floats, texts as codes, by their kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..errors import FileError
from .format import Labels, decoded_text

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
