"""Tables in memory, of any library, as the readings that a file would hold."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, KindError, MissingExtraError
from ..formats.columns import find_columns
from ..formats.format import Format
from ..support.files import InputFile
from ..support.labelled import take_apart
from ..support.roles import Wanted
from .readings import FileReadings


class _Memory(Format):
    """A table that was never in a file: its rows are counted from 1."""

    def line_of(self, path: Path, row: int) -> int:
        return row + 1


_MEMORY = _Memory("", {"a table in memory": ()})


def table_readings(data: Any, name: str, wanted: Wanted) -> FileReadings | None:
    """The readings of a table; None of what is none.

    A table is a mapping of names to arrays, a structured array, or a table of pandas, polars (a
    lazy one is collected), pyarrow, xarray, Dask (computed), or any other with the Arrow stream
    ``__arrow_c_stream__`` (a relation of DuckDB). ``name`` is what messages call it.

    Raises
    ------
    ArgumentError, KindError
        Columns that are no vectors of one length, or have other names than texts.
    FileError
        A column that was asked for is missing; ``name`` stands in place of a file.
    """
    held = _columns(data)
    if held is None:
        return None
    if not all(isinstance(column, str) for column in held):
        raise KindError(f"{name}: columns must have text for names, got {list(held)!r:.60}")
    path = Path(name)
    roles = find_columns(path, list(held), wanted)
    dated = roles["when"].name if "when" in roles else None
    columns = {
        column: _dates(values) if column == dated else _values(values)
        for column, values in held.items()
    }
    for column, values in columns.items():
        if values.ndim != 1 or values.size != next(iter(columns.values())).size:
            raise ArgumentError(
                f"{name}: column {column!r} has the shape {values.shape}; columns must be "
                "one-dimensional and equally long"
            )
    return FileReadings(path, _MEMORY, roles, columns, InputFile(name, ""))


def _columns(data: Any) -> dict[Any, Any] | None:
    """Columns by name, as the library holds them."""
    if isinstance(data, Mapping) and not hasattr(data, "variables"):
        return dict(data)
    if isinstance(data, np.ndarray):
        return None if data.dtype.names is None else {name: data[name] for name in data.dtype.names}
    if type(data).__name__ == "LazyFrame":
        data = data.collect()
    elif hasattr(data, "map_partitions") and hasattr(data, "compute"):
        data = data.compute()
    held = getattr(data, "variables", None)  # xarray's coordinates count as well
    if isinstance(held, Mapping):
        return dict(held)
    frames = {"pandas": "DataFrame", "polars": "DataFrame"}
    for library, kind in frames.items():
        module = sys.modules.get(library)
        if module is not None and isinstance(data, getattr(module, kind)):
            return {column: data[column] for column in data.columns}
    if not hasattr(data, "__arrow_c_stream__") and not hasattr(data, "__arrow_c_array__"):
        return None
    if not hasattr(data, "column_names"):
        data = _arrow_table(data)
    return {column: data.column(i) for i, column in enumerate(data.column_names)}


def _arrow_table(data: Any) -> Any:
    try:
        import pyarrow
    except ModuleNotFoundError:
        raise MissingExtraError("Arrow streams need pyarrow: pip install 'trueangle[arrow]'") from (
            None
        )
    if hasattr(data, "read_all"):
        return data.read_all()
    if not hasattr(data, "__arrow_c_stream__"):
        return pyarrow.record_batch(data)
    return pyarrow.RecordBatchReader.from_stream(data).read_all()


def _values(column: Any) -> NDArray[Any]:
    """A column as numbers, NaN where one is missing, or as objects where it holds others.

    Times of day and durations are seconds, from the first and as they are.
    """
    values = np.asarray(take_apart(column)[0])
    if values.dtype.kind == "M" and values.ndim == 1:
        known = values[~np.isnat(values)]
        values = values - (known[0] if known.size else np.datetime64("NaT"))
    if values.dtype.kind == "m":
        return np.asarray(values / np.timedelta64(1, "s"))
    if values.dtype.kind in "fiub":
        return values
    objects = values.astype(object)
    missing = [_is_missing(value) for value in objects.ravel()]
    if any(missing) and all(m or _is_number(v) for m, v in zip(missing, objects, strict=False)):
        return np.array([np.nan if m else v for m, v in zip(missing, objects, strict=True)], float)
    return objects


def _dates(column: Any) -> NDArray[Any]:
    """Dates and times as ISO 8601 writes them; texts as they are."""
    values = np.asarray(take_apart(column)[0])
    if values.dtype.kind == "M":
        return np.datetime_as_string(values, "us").astype(object)
    return values.astype(object)


def _is_missing(value: Any) -> bool:
    """None, NaN, and what pandas has in place of them."""
    return (
        value is None
        or (isinstance(value, float) and value != value)
        or type(value).__name__ in ("NAType", "NaTType")
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
