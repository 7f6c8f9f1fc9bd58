"""What holds readings: files, folders, patterns, tables in memory; one door for all of them."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, KindError, MissingExtraError
from ..formats.columns import find_columns
from ..formats.format import Format
from ..support.angles import check_period, unit_name
from ..support.files import InputFile
from ..support.labelled import take_apart
from ..support.roles import RoleColumn, Wanted, wanted_columns
from ..support.suggestions import did_you_mean
from .paths import find_logs, unit_of_path
from .rawchannels import checked_track_periods
from .readings import FileReadings, named_source, readings_of

T = TypeVar("T")


class OtherReadingOptions(TypedDict, total=False):
    """How columns are read, but for the unit of those that name none.

    Attributes
    ----------
    signals
        Columns with other names: ``{"torque": "tau", "reference": ("pos act", "rad")}``.
    by
        Column whose values separate the runs, in place of ``run``.
    counts_per_turn, counts_per_turn_reference
        Counts in one turn of the output, of an indicated angle or reference in counts or without
        a stated unit.
    topic
        JointState topic of a ROS bag (default: the only one).
    unit_from
        Regular expression; what it finds in the path of a file (its first group) is the unit
        of its runs.
    facets
        File of calibrated deviations of a polygon's facets.
    periods_per_turn
        Periods of a sine and a cosine channel in a turn, of two tracks a pair of numbers; the
        indicated angle is made of these.
    """

    signals: Mapping[str, Any] | None
    by: str | None
    counts_per_turn: float | None
    counts_per_turn_reference: float | None
    topic: str | None
    unit_from: str | None
    facets: Any
    periods_per_turn: int | tuple[int, ...] | None


class ReadingOptions(OtherReadingOptions, total=False):
    """Keyword arguments of all that takes files or tables of readings.

    Attributes
    ----------
    period
        One turn in the unit of angles whose columns do not name one: 360.0, ``2*pi``, 1.0, or
        counts. With it columns may be called just ``reference`` and ``indicated``.
    """

    period: float | None


def given_periods(reading: ReadingOptions) -> tuple[int, ...] | None:
    """Periods in a turn of every track; None where they are not given."""
    periods = reading["periods_per_turn"]
    return None if periods is None else checked_track_periods(periods)


def checked_reading_options(given: Mapping[str, Any]) -> ReadingOptions:
    """Keywords of reading, whole and checked; a ``period`` in counts is the counts of a turn.

    Raises
    ------
    TypeError
        A keyword of another name.
    ArgumentError
        A value that it cannot have.
    """
    for name in given:
        if name not in ReadingOptions.__annotations__:
            raise TypeError(
                f"got an unexpected keyword argument {name!r}"
                f"{did_you_mean(name, ReadingOptions.__annotations__)}"
            )
    signals, by = given.get("signals"), given.get("by")
    if signals is not None and not isinstance(signals, Mapping):
        raise KindError(f"signals must be a mapping of roles to columns, got {signals!r:.60}")
    if by is not None and not isinstance(by, str):
        raise KindError(f"by must be the name of a column, got {by!r:.60}")
    if by is not None and "run" in (signals or {}):
        raise ArgumentError("`by=` and `signals={'run': 'NAME'}` both name the runs; give one")
    found = ReadingOptions(
        signals={**(signals or {}), **({} if by is None else {"run": by})},
        period=given.get("period"),
        by=None,
        counts_per_turn=given.get("counts_per_turn"),
        counts_per_turn_reference=given.get("counts_per_turn_reference"),
        topic=given.get("topic"),
        unit_from=given.get("unit_from"),
        facets=given.get("facets"),
        periods_per_turn=given.get("periods_per_turn"),
    )
    given_periods(found)
    if found["unit_from"] is not None:
        try:
            re.compile(found["unit_from"])
        except (re.error, TypeError) as cause:
            raise ArgumentError(f"unit_from must be a regular expression: {cause}") from None
    if found["period"] is not None:
        check_period(found["period"])
        if unit_name(found["period"]) == "count":
            if found["counts_per_turn"] is None:
                found["counts_per_turn"] = found["period"]
            if found["counts_per_turn_reference"] is None:
                found["counts_per_turn_reference"] = found["period"]
    return found


def each_table(
    data: Any,
    read: Callable[[FileReadings], T],
    reading: ReadingOptions,
    name: str = "runs",
    table: str = "table",
) -> list[T]:
    """What ``read`` makes of every table: one of each file, one of each table in memory.

    ``data`` are paths of files, folders and patterns (``"log*.csv"``), tables as
    `tables.table_readings` takes them, or lists of both; ``reading`` is as
    `checked_reading_options` gives it, ``name`` and ``table`` as in `files.runs_of`.

    Raises
    ------
    ArgumentError, KindError
        Neither a path nor a table; no data.
    FileError
        A file cannot be read.
    """
    wanted = wanted_columns(reading["signals"])
    period, topic = reading["period"], reading["topic"]

    def of_file(unit: str | None) -> Callable[[Path], T]:
        return lambda file: read(
            _with_unit(_of_joint(readings_of(file, wanted, topic), unit), period)
        )

    def of_one(entry: Any, called: str) -> list[T] | None:
        if isinstance(entry, str | PathLike):
            return [
                named_source(path, of_file(unit_of_path(path, reading["unit_from"])))
                for path, _ in find_logs([entry], whole=False)
            ]
        try:
            held = _table_readings(entry, called, wanted)
        except KindError as error:
            raise KindError(f"{name}: {error}") from None
        return None if held is None else [read(_with_unit(held, period))]

    found = of_one(data, table)
    if found is not None:
        return found
    if not isinstance(data, Iterable) or not getattr(data, "ndim", True):
        raise KindError(
            f"{name} must be paths, runs, or tables (a mapping of names to arrays; pandas, polars, "
            f"pyarrow, DuckDB, xarray), got {data!r:.60} ({type(data).__name__})"
        )
    found = []
    for i, entry in enumerate(data):
        of_entry = of_one(entry, f"{table}[{i}]")
        if of_entry is None:
            raise KindError(
                f"{name}[{i}] must be a path, a run or a table, got {entry!r:.60} "
                f"({type(entry).__name__})"
            )
        found += of_entry
    if not found:
        raise ArgumentError(f"{name} is empty: at least one file, table or run is needed")
    return found


def _of_joint(table: FileReadings, unit: str | None) -> FileReadings:
    """The table with all rows assigned to one unit, found in the name of the file."""
    if unit is None:
        return table
    if "unit" in table.roles:
        raise table.error(
            "names the unit of every row, and so does `unit_from=`; leave one out",
            table.roles["unit"].name,
        )
    rows = len(next(iter(table.columns.values()), ()))
    roles = {**table.roles, "unit": RoleColumn("unit", "unit", None, True)}
    return table._replace(
        roles=roles, columns={**table.columns, "unit": np.full(rows, unit, dtype=object)}
    )


def _with_unit(table: FileReadings, period: float | None) -> FileReadings:
    """The table with angles without a stated unit in that of ``period``."""
    if period is None:
        return table
    unit = unit_name(period)
    bare: dict[str, RoleColumn] = {
        role: RoleColumn(role, role, unit, True)
        for role in ("reference", "indicated")
        if role not in table.roles and role in table.columns
    }
    kind = replace(table.format, unit=unit)
    return table._replace(roles={**table.roles, **bare}, format=kind)


class _Memory(Format):
    """A table that was never in a file: its rows are counted from 1."""

    def line_of(self, path: Path, row: int) -> int:
        return row + 1


_MEMORY = _Memory("", {"a table in memory": ()})


def _table_readings(data: Any, name: str, wanted: Wanted) -> FileReadings | None:
    """The readings of a table; None of what is none.

    A table is a mapping of names to arrays, a structured array, or a table of pandas, polars (a
    lazy one is collected), pyarrow, xarray, Dask (computed), or any other with the Arrow stream
    ``__arrow_c_stream__`` (a relation of DuckDB). ``name`` is what messages call it.

    Raises
    ------
    ArgumentError, KindError
        Columns that are no vectors of one length, or have other names than texts.
    FileError
        A requested column is missing; the message has ``name`` in place of a file.
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
