"""Calibration runs from CSV and Parquet files, one row per reading."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .angles import UNIT_PERIODS
from .errors import ArgumentError, FileError, MissingExtraError
from .files import RUNS_BYTES, read_whole
from .runs import CalibrationRun, Source
from .signals import FIELDS, SIGNALS, Signal, find_signal

__all__ = ["read_runs"]

_UNITS = (*UNIT_PERIODS, "count")


def read_runs(
    path: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    counts_per_turn: float | None = None,
) -> list[CalibrationRun]:
    """Calibration runs of one file or several, in the order the files name them.

    Parameters
    ----------
    path : path or iterable of paths
        CSV (comma, semicolon or tab; first line the header) or Parquet. Columns:
        ``reference_deg`` and ``indicated_deg`` (or ``_rad``, ``_turn``; ``indicated_count``
        with ``counts_per_turn``), and optionally ``run``, ``time_s``, ``temperature_C``,
        ``torque_Nm``, ``mount_deg``, ``velocity_deg_s``. Others are kept in
        `CalibrationRun.columns`.
    counts_per_turn : float, optional
        Counts of ``indicated_count`` in one turn of the output.

    Returns
    -------
    list of CalibrationRun
        One per label of ``run`` and file; rows stay in their order. The period of a run
        is that of its reference column: 360, ``2*pi`` or 1.

    Raises
    ------
    FileError
        Names file, line (header = 1) and column: a missing or doubled column, text or
        a non-finite value where a number belongs, units mixed within a file, time that
        runs backwards within a run, an empty file.
    MissingExtraError
        Parquet without pyarrow.
    """
    if isinstance(path, (str, PathLike)):
        return _read_file(Path(path), counts_per_turn)
    runs = [run for entry in path for run in _read_file(Path(entry), counts_per_turn)]
    units = {run.period: run for run in runs}
    if len(units) > 1:
        first, other = list(units.values())[:2]
        raise FileError(
            other.source.file if other.source else "runs",
            f"its angles are in another unit (period {other.period:g}) than those of "
            f"{first.source.file if first.source else 'the first file'} "
            f"(period {first.period:g}); convert one of them",
        )
    return runs


class _Table:
    """Columns of one file as text or numbers, with the line every row came from."""

    def __init__(self, path: Path, columns: Mapping[str, Any], lines: NDArray[np.int64]) -> None:
        self.path = path
        self.columns = columns
        self.lines = lines

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Column ``name`` as finite floats."""
        column = self.columns[name]
        try:
            values = np.asarray(column).astype(np.float64)
        except (TypeError, ValueError):
            for row, text in enumerate(column):
                try:
                    float(text)
                except (TypeError, ValueError):
                    got = "an empty cell" if text in ("", None) else repr(text)
                    raise self.error(row, name, f"a number is needed, got {got}") from None
            raise
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            row = int(bad[0])
            raise self.error(row, name, f"readings must be finite, got {values[row]}; drop the row")
        return values

    def error(self, row: int, column: str, problem: str) -> FileError:
        return FileError(self.path, problem, line=int(self.lines[row]), column=column)


class RunColumns(NamedTuple):
    """Columns of one file of runs as they were read, nothing of them judged but the numbers."""

    table: _Table
    period: float
    reference: NDArray[np.float64]
    indicated: NDArray[np.float64]
    signals: dict[str, NDArray[np.float64]]
    groups: list[tuple[str | None, str | None, NDArray[np.intp]]]  # unit, label, rows
    source: Source


def read_columns(path: Path, counts_per_turn: float | None) -> RunColumns:
    """The columns of one file, grouped by run; time may run backwards."""
    data = read_whole(
        path,
        RUNS_BYTES,
        "a table of runs",
        "fit_logs (trueangle fit --one-pass) reads more, in constant memory",
    )
    source = Source(path.name, hashlib.sha256(data).hexdigest())
    parquet = data[:4] == b"PAR1" or path.suffix in (".parquet", ".pq")
    table = _parquet(path, data) if parquet else _csv(path, data)
    period, angles = _angles(table, counts_per_turn)
    scalars = {}
    for signal in _signals_of(table.columns):
        for column, factor in _places(signal, period):
            if column in table.columns:
                scalars[signal.name] = table.numbers(column) * factor
    return RunColumns(
        table, period, angles["reference"], angles["indicated"], scalars, _groups(table), source
    )


def _read_file(path: Path, counts_per_turn: float | None) -> list[CalibrationRun]:
    table, period, reference, indicated, scalars, groups, source = read_columns(
        path, counts_per_turn
    )
    known = {"run", "unit", *(SIGNALS[name].column for name in ("time", "temperature", "torque"))}
    others = {k: _kept(v) for k, v in table.columns.items() if k not in known}
    runs = []
    for unit, label, rows in groups:
        _check_time(table, scalars.get("time"), rows)
        fields: dict[str, Any] = {k: v[rows] for k, v in scalars.items() if k in FIELDS}
        runs.append(
            CalibrationRun(
                reference[rows],
                indicated[rows],
                **fields,
                period=period,
                label=label,
                unit=unit,
                signals={k: v[rows] for k, v in scalars.items() if k not in FIELDS},
                columns={name: values[rows] for name, values in others.items()},
                source=source,
            )
        )
    return runs


def _csv(path: Path, data: bytes) -> _Table:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as cause:
        line = data.count(b"\n", 0, cause.start) + 1
        raise FileError(path, "is not UTF-8 text; save it as CSV in UTF-8", line=line) from None
    header_line = text.partition("\n")[0].strip()
    if not header_line:
        raise FileError(path, "is empty; a header line and readings are needed", line=1)
    delimiter = max(",;\t", key=header_line.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    header = [name.strip() for name in next(reader)]
    doubled = {name for name in header if header.count(name) > 1}
    if doubled:
        raise FileError(path, "the column appears twice", line=1, column=min(doubled))
    rows, lines = [], []
    try:
        for row in reader:
            if not row or (len(row) == 1 and not row[0].strip()):
                continue
            if len(row) != len(header):
                raise FileError(
                    path,
                    f"{len(row)} values where the header has {len(header)} columns",
                    line=reader.line_num,
                )
            rows.append(row)
            lines.append(reader.line_num)
    except csv.Error as cause:
        raise FileError(path, f"is not readable as CSV: {cause}", line=reader.line_num) from None
    if not rows:
        raise FileError(path, "has a header but no readings", line=1)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    return _Table(path, columns, np.array(lines))


def _parquet(path: Path, data: bytes) -> _Table:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError(
            f"{path}: reading Parquet needs pyarrow: pip install 'trueangle[arrow]'"
        ) from None
    try:
        table = pq.read_table(pa.BufferReader(data))
    except pa.ArrowException as cause:
        raise FileError(path, f"is not readable as Parquet: {cause}") from None
    columns = {
        name: table[name].to_pylist()
        if table[name].null_count
        else table[name].to_numpy(zero_copy_only=False)
        for name in table.column_names
    }
    if table.num_rows == 0:
        raise FileError(path, "has no readings")
    # There are no lines: rows counted from 1, as if under a header.
    return _Table(path, columns, np.arange(2, table.num_rows + 2))


def _angles(
    table: _Table, counts_per_turn: float | None
) -> tuple[float, dict[str, NDArray[np.float64]]]:
    """Period of the file and its two angles in that unit."""
    units = {what: _unit(table, what) for what in ("reference", "indicated")}
    unit, indicated_unit = units["reference"], units["indicated"]
    if unit == "count":
        raise FileError(
            table.path,
            "a reference in counts has no fixed unit; use reference_deg, _rad or _turn",
            line=1,
            column="reference_count",
        )
    period = UNIT_PERIODS[unit]
    reference = table.numbers(f"reference_{unit}")
    indicated = table.numbers(f"indicated_{indicated_unit}")
    if indicated_unit == "count":
        if counts_per_turn is None:
            raise FileError(
                table.path,
                "counts need their number per output turn: give --counts-per-turn "
                "(counts_per_turn= in Python)",
                line=1,
                column="indicated_count",
            )
        if not (math.isfinite(counts_per_turn) and counts_per_turn > 0):
            raise ArgumentError(f"counts_per_turn must be positive, got {counts_per_turn!r}")
        indicated = indicated * (period / counts_per_turn)
    elif indicated_unit != unit:
        raise FileError(
            table.path,
            f"units are mixed: reference in {unit}, indicated in {indicated_unit}; convert one",
            line=1,
            column=f"indicated_{indicated_unit}",
        )
    return period, {"reference": reference, "indicated": indicated}


def _unit(table: _Table, what: str) -> str:
    found = [unit for unit in _UNITS if f"{what}_{unit}" in table.columns]
    if len(found) == 1:
        return found[0]
    if found:
        raise FileError(
            table.path,
            f"units are mixed: {' and '.join(f'{what}_{u}' for u in found)}; keep one",
            line=1,
            column=f"{what}_{found[1]}",
        )
    wanted = ", ".join(f"{what}_{unit}" for unit in (_UNITS if what == "indicated" else _UNITS[:3]))
    raise FileError(
        table.path,
        f"no column {what}_deg (one of {wanted} is needed); "
        f"its columns are {', '.join(table.columns)}",
        line=1,
    )


def _signals_of(columns: Iterable[str]) -> Iterator[Signal]:
    """Signals that may be among the columns: those of the list, and the heads by number."""
    yield from SIGNALS.values()
    heads = {name.partition("_")[0] for name in columns if name.startswith("head")}
    for name in sorted(heads):
        try:
            yield find_signal(name)
        except ArgumentError:
            continue


def _places(signal: Signal, period: float) -> Iterator[tuple[str, float]]:
    """Columns that may hold a signal, each with the factor to the unit of the run."""
    if signal.kind in ("angle", "velocity"):
        for unit, turn in UNIT_PERIODS.items():
            yield signal.column.format(unit), period / turn
    else:
        yield signal.column, 1.0


def _kept(values: Any) -> NDArray[Any]:
    """A column as it is; texts as objects, since an array of texts is as wide as the longest."""
    if isinstance(values, np.ndarray):
        return values
    return np.fromiter(values, dtype=object, count=len(values))


def _groups(table: _Table) -> list[tuple[str | None, str | None, NDArray[np.intp]]]:
    """Unit, label and rows of every run, in the order of their first row."""
    names = [name for name in ("unit", "run") if name in table.columns]
    rows: dict[tuple[str, ...], list[int]] = {}
    keys = zip(*(map(str, table.columns[name]) for name in names), strict=True)
    for i, key in enumerate(keys):
        rows.setdefault(key, []).append(i)
    if not names:
        return [(None, None, np.arange(table.lines.size))]
    found = []
    for key, places in rows.items():
        labels = dict(zip(names, key, strict=True))
        found.append((labels.get("unit"), labels.get("run"), np.array(places, dtype=np.intp)))
    return found


def _check_time(table: _Table, time: NDArray[np.float64] | None, rows: NDArray[np.intp]) -> None:
    if time is None:
        return
    back = np.flatnonzero(np.diff(time[rows]) < 0.0)
    if back.size:
        row = int(rows[back[0] + 1])
        raise table.error(
            row,
            "time_s",
            f"time runs backwards within the run: {time[row]:g} after "
            f"{time[rows[back[0]]]:g}; sort the rows or give the part another run label",
        )
