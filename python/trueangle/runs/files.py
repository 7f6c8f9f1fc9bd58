"""Calibration runs from files and tables, one row per reading."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias, Unpack

import numpy as np
from numpy.typing import NDArray

from ..errors import EmptyCellsWarning, FileError, UnreadColumnWarning, level_of_caller
from ..support.argumentkinds import told_kinds
from ..support.decoding import local_day
from ..support.files import InputFile
from ..support.layout import counted
from ..support.roles import LABELS, RoleColumn, checked_count_turn, role_code, unit_in_name
from ..support.signals import FIELDS
from .angles import PERIOD, Facets, find_run_angles, read_facets
from .channelangle import with_channel_angle
from .rawchannels import Channels
from .readings import FileReadings
from .run import CalibrationRun, as_runs, runs_or_data
from .source import ReadingOptions, checked_reading_options, each_table, given_periods


class _RunLabels(NamedTuple):
    """What identifies a run: its joint, when it was calibrated, and its label."""

    unit: str | None = None
    when: str | None = None
    run: str | None = None


#: Labels and rows of every run.
Groups: TypeAlias = list[tuple[_RunLabels, NDArray[np.intp]]]


@told_kinds
def read_runs(path: Any, **reading: Unpack[ReadingOptions]) -> list[CalibrationRun]:
    """Calibration runs of files or tables, in the order these name them.

    Parameters
    ----------
    path : path, table, or iterable of them
        Files, folders (and all below), patterns (``"logs/*.csv"``): CSV (comma, semicolon or
        tab, decimal points or commas, lines before the names, notes that begin with #, a line
        of units; also packed by gzip or zstd), Excel, Parquet, Arrow, HDF5, MATLAB, numpy, ROS
        bags, MCAP, MDF4. Tables in memory: a mapping of names to arrays, a structured array, or
        one of pandas, polars (also lazy), pyarrow, DuckDB, xarray, Dask. Columns:
        ``reference_deg`` and ``indicated_deg`` (or ``_rad``, ``_turn``, ``_count``, or a unit in
        brackets), and optionally ``run``,
        ``unit``, ``when`` (ISO 8601) and those of `trueangle.support.signals.SIGNALS`; an
        ``error_arcsec`` (or another unit) may replace one of the two angles. Others are
        kept in `CalibrationRun.columns`.
    **reading
        ``counts_per_turn``, ``counts_per_turn_reference``: counts in one turn of the output,
        of an indicated angle or reference in counts or without a stated unit.
        ``signals``: columns with other names,
        ``{"torque": "tau", "reference": ("pos act", "rad")}``; ``"-pos"`` is a reversed sensor
        (`CalibrationRun.indicated_sign`), and ``"reference_offset"`` (a list for several) is
        added to the reference. ``facets``: a file of a polygon's facets (``reference_deg``,
        ``deviation_arcsec``), added at its nominal angles. ``unit_from``: a regular expression;
        what it finds in the name of a file is the unit of its runs. ``period``: one turn in the
        unit of angles whose columns name none; these may then be called ``reference`` and
        ``indicated``. ``by``: the column that separates the runs (default: ``run``).
        ``topic``: JointState topic of a ROS bag (default: the only one). ``periods_per_turn``:
        periods in a turn of the columns ``sine`` and ``cosine``, of which the indicated angle is
        then made, as it is where no column has it; of two tracks (``sine2``, ``cosine2``) both
        numbers.

    Returns
    -------
    list of CalibrationRun
        One per unit, day of ``when``, label of ``run`` and file or table; rows stay in their
        order. The period
        of a run is that of its reference column: 360, ``2*pi`` or 1; 360 for other units.

    Raises
    ------
    FileError
        Names file, line (header = 1) and column: a missing or doubled column, text or
        a non-finite value where a number belongs, units mixed within a file, time that
        runs backwards within a run, an empty file. Rows of a table count from 1.
    ArgumentError
        Neither paths nor tables.
    MissingExtraError
        A format whose library is not installed.

    Warns
    -----
    EmptyCellsWarning
        Rows with an empty cell were omitted; `CalibrationRun.left_out` counts them.

    Examples
    --------
    >>> read_runs({"reference": [0.0, 90.0], "indicated": [0.1, 90.1]}, period=360.0)
    [CalibrationRun(None, 2 readings, period=360)]
    """
    return _read(path, checked_reading_options(reading), "path")


def runs_of(
    data: Any, reading: Mapping[str, Any], name: str = "runs", table: str = "table"
) -> list[CalibrationRun]:
    """Runs as they are, those of what `read_runs` reads, or of a list of both.

    ``reading`` holds keywords of `read_runs`, which runs do not need; ``name`` and ``table`` are
    what messages call the data, and a table in memory in place of a file.

    Raises
    ------
    ArgumentError
        None of these; no run at all; runs in different units.
    FileError
        As `read_runs`.
    """
    runs, data = runs_or_data(data)
    if runs is not None and not reading:
        return runs if len(runs) == 1 else as_runs(runs)
    asked = checked_reading_options(reading)
    return _read(data, asked, name, table) if runs is None else as_runs(runs)


def each_runs(
    data: Any, reading: Mapping[str, Any], take: Callable[[list[CalibrationRun]], None]
) -> None:
    """Hand over the runs of one file or table after the other, so that none need be kept.

    ``take`` is called with the runs of each; ``data`` and ``reading`` are those of `runs_of`.

    Raises
    ------
    ArgumentError, FileError
        As `runs_of`; runs in different units are left to ``take``.
    """
    asked = checked_reading_options(reading)
    runs, data = runs_or_data(data)
    if runs is not None:
        take(as_runs(runs))
        return
    given = Conversion.of(asked)
    each_table(data, lambda table: take(_runs_of_readings(table, given)), asked)


def _read(
    data: Any, reading: ReadingOptions, name: str, table: str = "table"
) -> list[CalibrationRun]:
    given = Conversion.of(reading)
    found = each_table(data, lambda t: _runs_of_readings(t, given), reading, name, table)
    runs = [run for part in found for run in part]
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


class Conversion(NamedTuple):
    """Counts in a turn of either angle, and the facets of a polygon."""

    counts: float | None = None
    reference_counts: float | None = None
    facets: Facets | None = None
    periods: tuple[int, ...] | None = None

    @classmethod
    def of(cls, reading: ReadingOptions) -> Conversion:
        """From the keywords of `read_runs`."""
        facets = reading["facets"]
        return cls(
            checked_count_turn(reading["counts_per_turn"], "counts_per_turn"),
            checked_count_turn(reading["counts_per_turn_reference"], "counts_per_turn_reference"),
            facets if facets is None or isinstance(facets, Facets) else read_facets(facets),
            given_periods(reading),
        )


class _RunColumns(NamedTuple):
    """Columns of one file of runs as they were read, nothing of them judged but the numbers.

    Angles and signals are in the unit of ``period``; ``groups`` are unit, label, and the
    rows without an empty cell of every run, in the order of their first row.
    """

    table: FileReadings
    period: float
    reference: NDArray[np.float64]
    indicated: NDArray[np.float64]
    signals: dict[str, NDArray[np.float64]]
    groups: Groups
    left_out: list[int]
    source: InputFile
    indicated_sign: int
    channels: Channels | None = None
    dropouts: NDArray[np.bool_] | None = None


def read_columns(data: Any, reading: ReadingOptions) -> list[_RunColumns]:
    """The columns of every file or table, grouped by run; time may run backwards."""
    given = Conversion.of(reading)
    return each_table(data, lambda table: _columns(table, given), reading, "data")


def _columns(table: FileReadings, given: Conversion) -> _RunColumns:
    asked = {role for role, column in table.roles.items() if column.is_asked}
    filled = any(len(column) for column in table.columns.values())
    # A log of an angle called indicated_deg is no table.
    if len(table.columns) == 1 and filled and table.roles.keys() <= asked & {"indicated"}:
        return _entries(table, given.counts)
    channels = dropouts = None
    if given.periods is not None or {"sine", "cosine"} & table.roles.keys():
        from .channelangle import demodulated  # most tables have no channels

        table, excitation = demodulated(table)
        table, channels, dropouts = with_channel_angle(table, given.periods, given.reference_counts)
        if channels is not None and excitation is not None:
            channels = channels.replace(excitation_deg=excitation)
    roles, path = table.roles, table.path
    if not roles.keys() & {"reference", "indicated", "error"}:
        _refuse_channels_in_rows(table)
    angles = find_run_angles(
        path,
        list(table.columns),
        roles,
        unit=table.format.unit,
        counts_per_turn=given.counts,
        counts_per_turn_reference=given.reference_counts,
        facets=given.facets,
    )
    if not len(next(iter(table.columns.values()))):
        raise FileError(path, "has a header but no readings", line=1)
    period = angles.period
    raw = {column.name: column for column in roles.values()}
    reference, indicated = angles.values(lambda name: table.raw(raw[name]))
    signals = {}
    for role, column in roles.items():
        if (role not in LABELS and column.name not in angles.names) or role == "mount":
            if (column.unit or "").startswith("count"):
                raise table.error(
                    "counts of this signal have no known turn; give it in deg, rad or turn",
                    column.name,
                )
            signals[role] = column.values(table.raw(column), period)
    missing = np.zeros(reference.size, dtype=bool)
    for values in (reference, indicated, *signals.values()):
        missing |= np.isnan(values)
    empty = missing if dropouts is None else missing & ~dropouts
    if dropouts is not None:
        missing |= dropouts
    groups, left_out = [], []
    for found, rows in _groups(table, reference.size):
        present = rows[~missing[rows]]
        if not present.size:
            problem = f"every row of run {found.run or path.name} has an empty cell"
            counts = {
                "--counts-per-turn": given.counts,
                "--counts-per-turn-reference": given.reference_counts,
            }
            from .angles import two_channels

            raise FileError(path, problem + two_channels(table, counts, reference, indicated))
        groups.append((found, present))
        left_out.append(rows.size - present.size)
    _warn_of_empty(table, empty, {"reference": reference, "indicated": indicated, **signals})
    return _RunColumns(
        table,
        period,
        reference,
        indicated,
        signals,
        groups,
        left_out,
        table.source,
        angles.indicated_sign,
        channels,
        dropouts,
    )


def _refuse_channels_in_rows(table: FileReadings) -> None:
    """Refuse a log of readings in rows of their own, each with the name of its channel."""
    for name, values in table.columns.items():
        if values.dtype == object and name not in (c.name for c in table.roles.values()):
            labels = list(dict.fromkeys(values.tolist()))
            if len(labels) == 2:
                files = ", ".join(f'"{label}.csv"' for label in labels)
                raise table.error(
                    f"each row is of one of two channels, {labels[0]} and {labels[1]}: write each "
                    f'with its times to a file, and join them: `ta.join({files}, output="RUNS")`',
                    name,
                )


def _entries(table: FileReadings, counts: float | None) -> _RunColumns:
    """A table of a turn as firmware holds it: entry i of n is the reading at i/n of a turn."""
    (name,) = table.columns
    column = table.roles.get("indicated", RoleColumn("indicated", name, None))
    unit = column.unit or unit_in_name(name, "indicated") or (None if counts is None else "count")
    if unit is None or (unit == "count" and counts is None):
        raise table.error(
            "one column is read as a table with entry i of n at i/n of a turn. "
            f"Its unit is unknown: give {role_code('indicated', name, 'deg')} (or another "
            "unit), or `counts_per_turn=`; or name the file's reference column",
            name,
        )
    indicated = column._replace(unit=unit).values(table.raw(column), PERIOD, counts)
    reference = np.linspace(0.0, PERIOD, indicated.size, endpoint=False, dtype=np.float64)
    rows = np.flatnonzero(~np.isnan(indicated))
    if not rows.size:
        raise FileError(table.path, "has a header but no readings", line=1)
    left_out = indicated.size - rows.size
    _warn_of_empty(table, np.isnan(indicated), {"indicated": indicated})
    groups: Groups = [(_RunLabels(), rows)]
    return _RunColumns(
        table, PERIOD, reference, indicated, {}, groups, [left_out], table.source, column.sign
    )


def _runs_of_readings(table: FileReadings, given: Conversion) -> list[CalibrationRun]:
    """Runs of the rows of a table; raises as `read_runs`."""
    found = _columns(table, given)
    signals, table = found.signals, found.table
    if found.dropouts is not None and (off := np.flatnonzero(found.dropouts)).size:
        from .checks.channelreadings import dropout_words

        fault = "; ".join(dropout_words(int(off.size), int(off[0]) + 1))
        warnings.warn(f"{table.path}: {fault}", EmptyCellsWarning, stacklevel=level_of_caller())
    used = {c.name for role, c in table.roles.items() if c.is_asked or role in _USED}
    others = {name: values for name, values in table.columns.items() if name not in used}
    runs = []
    for (labels, rows), left_out in zip(found.groups, found.left_out, strict=True):
        if "time" in signals:
            _check_time(table, signals["time"], rows)
        fields: dict[str, Any] = {k: v[rows] for k, v in signals.items() if k in FIELDS}
        runs.append(
            CalibrationRun(
                found.reference[rows],
                found.indicated[rows],
                **fields,
                period=found.period,
                label=labels.run,
                unit=labels.unit,
                when=labels.when,
                left_out=left_out,
                signals={k: v[rows] for k, v in signals.items() if k not in FIELDS},
                columns={name: values[rows] for name, values in others.items()},
                source=found.source,
                indicated_sign=found.indicated_sign,
                channels=found.channels,
                roles=table.named,
            )
        )
    return runs


#: Roles whose columns are not repeated among the other columns of a run.
_USED = ("time", "temperature", "torque", "error", *LABELS)


def _warn_of_empty(
    table: FileReadings, missing: NDArray[np.bool_], values: Mapping[str, NDArray[np.float64]]
) -> None:
    count = int(np.count_nonzero(missing))
    if count:
        row = int(np.flatnonzero(missing)[0])
        role = next(role for role, found in values.items() if np.isnan(found[row]))
        line = table.format.line_of(table.path, row)
        warnings.warn(
            f"{table.path}: {count} of {counted(missing.size, 'row')} "
            f"{'has an empty cell and is' if count == 1 else 'have an empty cell and are'} "
            f"omitted, the first at line {line}, column '{_column_of(table, role)}'",
            EmptyCellsWarning,
            stacklevel=level_of_caller(),
        )


def _column_of(table: FileReadings, role: str) -> str:
    return table.roles[role].name if role in table.roles else next(iter(table.columns))


def _groups(table: FileReadings, size: int) -> Groups:
    """Labels and rows of every run, in the order of their first row: of one day each."""
    columns = {
        role: [*map(_label, table.columns[table.roles[role].name].tolist())]
        for role in _RunLabels._fields
        if role in table.roles
    }
    if not columns:
        return [(_RunLabels(), np.arange(size))]
    days = {text: local_day(text) for text in set(columns.get("when", ()))}
    if not all(days.values()):
        row = next(i for i, text in enumerate(columns["when"]) if not days[text])
        got = repr(columns["when"][row])[:60]
        problem = f"a date and time (ISO 8601) is needed, got {got}"
        error = table.error(problem, table.roles["when"].name, row)
        if table.roles["when"].is_asked:
            raise error
        warnings.warn(
            f"{error}; the column is ignored", UnreadColumnWarning, stacklevel=level_of_caller()
        )
        del columns["when"]  # a column of this name that holds something else
        days = {}
    if not columns:
        return [(_RunLabels(), np.arange(size))]
    keys = dict(columns)
    if days:
        keys["when"] = [days[text] for text in columns["when"]]
    rows: dict[tuple[str | None, ...], list[int]] = {}
    for i, key in enumerate(zip(*keys.values(), strict=True)):
        rows.setdefault(key, []).append(i)
    return [
        (
            _RunLabels(**{role: texts[places[0]] for role, texts in columns.items()}),
            np.array(places, dtype=np.intp),
        )
        for places in rows.values()
    ]


def _label(value: Any) -> str:
    return "" if value is None else str(value)


def _check_time(table: FileReadings, time: NDArray[np.float64], rows: NDArray[np.intp]) -> None:
    back = np.flatnonzero(np.diff(time[rows]) < 0.0)
    if back.size:
        row = int(rows[back[0] + 1])
        raise table.error(
            f"time runs backwards within the run: {time[row]:g} after "
            f"{time[rows[back[0]]]:g}; sort the rows or give the part another run label",
            table.roles["time"].name,
            row,
        )
