"""Calibration runs from whatever holds them: files, tables in memory, runs themselves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ArgumentError, KindError
from ..formats.columns import count_turn, find_columns, wanted_columns
from ..formats.format import Format
from .files import read_runs, runs_of_readings
from .readings import Readings
from .run import CalibrationRun, Source

__all__ = ["runs_of"]


class _Memory(Format):
    """A table that was never in a file: its rows are counted from 1."""

    def line_of(self, path: Path, row: int) -> int:
        return row + 1


_MEMORY = _Memory("", {"a table in memory": ()})


def runs_of(
    data: Any,
    *,
    name: str = "table",
    counts_per_turn: float | None = None,
    counts_per_turn_reference: float | None = None,
    signals: Mapping[str, Any] | None = None,
    topic: str | None = None,
) -> list[CalibrationRun]:
    """Runs of a path or several, of a table in memory, or runs as they are.

    Parameters
    ----------
    data : CalibrationRun, path, table, or iterable of runs or paths
        A table is a mapping of names to arrays, or a frame of pandas, polars, pyarrow or xarray,
        with the columns that a file of runs has.
    name : str
        What messages call the table.
    counts_per_turn, counts_per_turn_reference, signals, topic
        As `trueangle.read_runs`.

    Raises
    ------
    ArgumentError
        Neither runs nor a table nor a path.
    FileError
        As `trueangle.read_runs`; ``name`` stands in place of a file.

    Examples
    --------
    >>> runs_of({"reference_deg": [0.0, 90.0], "indicated_deg": [0.1, 90.1]})
    [CalibrationRun(None, 2 readings, period=360)]
    """
    if isinstance(data, CalibrationRun):
        return [data]
    names = _names(data)
    held = getattr(data, "variables", data)  # xarray's coordinates count as well
    if names is not None and isinstance(held, Mapping) and not {*names} <= {*held}:
        raise KindError(f"{name}: columns must have text for names, got {list(data)!r:.60}")
    if names is not None:
        columns = {column: _values(held[column]) for column in names}
        path = Path(name)
        roles = find_columns(path, names, wanted_columns(signals))
        for column, values in columns.items():
            if values.ndim != 1 or values.size != next(iter(columns.values())).size:
                raise ArgumentError(
                    f"{name}: column {column!r} has the shape {values.shape}; columns must be "
                    "one-dimensional and equally long"
                )
        table = Readings(path, _MEMORY, roles, columns, Source(name, ""))
        return runs_of_readings(
            table,
            count_turn(counts_per_turn, "counts_per_turn"),
            count_turn(counts_per_turn_reference, "counts_per_turn_reference"),
        )
    if isinstance(data, (str, PathLike)):
        given: Any = data
    elif isinstance(data, Iterable) and getattr(data, "ndim", True):
        given = list(data)
        if given and all(isinstance(entry, CalibrationRun) for entry in given):
            return list(given)
        if not given or not all(isinstance(entry, (str, PathLike)) for entry in given):
            raise ArgumentError(f"{name} holds neither runs nor paths: {given!r:.60}")
    else:
        raise ArgumentError(
            f"{name} must be a path, runs, a mapping of names to arrays, or a table of pandas, "
            f"polars, pyarrow or xarray; got {type(data).__name__}"
        )
    return read_runs(
        given,
        counts_per_turn=counts_per_turn,
        counts_per_turn_reference=counts_per_turn_reference,
        signals=signals,
        topic=topic,
    )


def _names(data: Any) -> list[str] | None:
    """Names of the columns of a table; None of what is none."""
    if hasattr(data, "variables"):
        return [str(name) for name in data.variables]
    if isinstance(data, Mapping):
        return [str(name) for name in data]
    for attribute in ("column_names", "columns"):
        found = getattr(data, attribute, None)
        if found is not None and hasattr(data, "__getitem__"):
            return [str(name) for name in found]
    return None


def _values(column: Any) -> np.ndarray[Any, Any]:
    """A column as numbers, or as objects where it holds anything else."""
    values = np.asarray(column)
    if values.dtype.kind == "m":
        return np.asarray(values / np.timedelta64(1, "s"))
    return values if values.dtype.kind in "fiub" else values.astype(object)
