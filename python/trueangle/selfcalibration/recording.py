"""What a log holds for self-calibration: time, the reading, other channels, per run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError, FileError
from ..formats.columns import Column, find_columns, role_kind, signal_code, wanted_columns
from ..runs.run import CalibrationRun, Source

__all__ = ["Counts", "Recording", "as_recordings"]

Array = NDArray[np.float64]

_LABELS = ("unit", "run")

#: Roles of columns that a recording keeps, besides the heads.
_CHANNELS = ("time", "indicated", "reference", "motor", "shift", "mount", "current")


@dataclass(frozen=True)
class Recording:
    """Channels of one run in radians and seconds, in the order they were read."""

    label: str | None
    time: Array | None = None
    indicated: Array | None = None
    reference: Array | None = None
    motor: Array | None = None
    shift: Array | None = None
    mount: Array | None = None
    heads: Mapping[int, Array] = field(default_factory=dict)
    current: Array | None = None
    file: str = ""
    source: Source | None = None

    def __len__(self) -> int:
        for channel in (self.indicated, self.motor, self.reference, *self.heads.values()):
            if channel is not None:
                return int(channel.size)
        return 0

    @property
    def named(self) -> str:
        """File and run, for messages."""
        run = f"run {self.label}" if self.label else ""
        return ", ".join(part for part in (self.file, run) if part) or "the log"


class Counts(NamedTuple):
    """Counts per turn of the readings and of a reference."""

    reading: float | None = None
    reference: float | None = None


def as_recordings(
    logs: Any,
    *,
    counts: Counts | None = None,
    signals: Mapping[str, Any] | None = None,
    topic: str | None = None,
) -> list[Recording]:
    """Recordings of files, calibration runs, or mappings of column names to arrays.

    Raises
    ------
    FileError, ArgumentError
        Files that cannot be read; columns in no known unit, of different lengths.
    """
    if isinstance(logs, (str, PathLike, Mapping, CalibrationRun, Recording)):
        logs = [logs]
    if not isinstance(logs, Iterable):
        raise ArgumentError(f"logs must be files or tables, got {type(logs).__name__}")
    counts = counts or Counts()
    found: list[Recording] = []
    for log in logs:
        if isinstance(log, Recording):
            found.append(log)
        elif isinstance(log, CalibrationRun):
            found.append(_of_run(log))
        elif isinstance(log, Mapping):
            found += _of_mapping(log, counts)
        else:
            found += _of_file(Path(log), counts, signals, topic)
    if not found:
        raise ArgumentError("logs is empty: at least one log is needed")
    return found


def _of_run(run: CalibrationRun) -> Recording:
    turn = 2.0 * np.pi / run.period

    def angle(name: str) -> Array | None:
        values = run.signal(name)
        return None if values is None else values * turn

    return Recording(
        label=run.label,
        time=run.time,
        indicated=run.indicated * turn,
        reference=run.reference * turn,
        motor=angle("motor"),
        shift=angle("shift"),
        mount=angle("mount"),
        heads={int(name[4:]): values * turn for name, values in run.heads.items()},
        current=run.signal("current"),
        file=run.source.file if run.source else "",
        source=run.source,
    )


def _of_mapping(table: Mapping[str, ArrayLike], counts: Counts) -> list[Recording]:
    columns = {str(name): np.asarray(values) for name, values in table.items()}
    shapes = {values.shape for values in columns.values()}
    if len(shapes) != 1 or any(len(shape) != 1 for shape in shapes):
        sizes = {name: values.shape for name, values in columns.items()}
        raise ArgumentError(f"columns must be vectors of one length, got {sizes}")
    roles = find_columns("the table", list(columns), wanted_columns(None))
    channels = {}
    for role, column in roles.items():
        if role not in _LABELS:
            raw = np.asarray(columns[column.name], dtype=np.float64)
            channels[role] = _in_radians(column, raw, counts, "")
    labels = [columns[roles[role].name] for role in _LABELS if role in roles]
    return _split(channels, labels, "", None)


def _of_file(
    path: Path, counts: Counts, signals: Mapping[str, Any] | None, topic: str | None
) -> list[Recording]:
    from ..runs.files import read_readings

    table = read_readings(path, signals, topic)
    channels = {
        role: _in_radians(
            column._replace(unit=column.unit or table.format.unit)
            if role_kind(role) == "angle"
            else column,
            table.raw(column),
            counts,
            str(path),
        )
        for role, column in table.roles.items()
        if role not in _LABELS
    }
    if not any(role in channels for role in ("indicated", "motor", "head1")):
        raise FileError(
            path,
            "no column indicated_deg (or _rad, _turn, _count), head1_deg or motor_deg; its "
            f"columns are {', '.join(list(table.columns)[:12])}",
            line=1,
        )
    labels = [table.columns[table.roles[role].name] for role in _LABELS if role in table.roles]
    return _split(channels, labels, str(path), table.source)


def _in_radians(column: Column, raw: Array, counts: Counts, file: str) -> Array:
    """A channel in radians, seconds or the unit of its only column."""
    turn = counts.reference if column.role == "reference" else counts.reading
    message = ""
    if role_kind(column.role) == "angle" and column.unit is None:
        message = f"its unit is not known; give it: {signal_code(column.role, column.name, 'deg')}"
    elif column.unit == "count" and turn is None:
        beside = "_reference" if column.role == "reference" else ""
        message = f"counts need their number per turn: give `counts_per_turn{beside}=`"
    if message:
        if file:
            raise FileError(file, message, line=1, column=column.name)
        raise ArgumentError(f"column {column.name!r}: {message}")
    return column.values(raw, 2.0 * np.pi, turn)


def _split(
    channels: Mapping[str, Array],
    labels: Sequence[NDArray[Any]],
    file: str,
    source: Source | None,
) -> list[Recording]:
    """One recording per unit and run, in the order of their first row, without empty rows."""
    if not channels:
        raise ArgumentError(f"{file or 'the table'} holds no column that is known")
    used = {name: values for name, values in channels.items() if name in _CHANNELS or _head(name)}
    size = next(iter(channels.values())).size
    present = np.ones(size, dtype=bool)
    for values in used.values():
        present &= np.isfinite(values)
    groups: dict[tuple[str, ...], list[int]] = {}
    if labels:
        for i, key in enumerate(zip(*(map(str, label) for label in labels), strict=True)):
            groups.setdefault(key, []).append(i)
    else:
        groups[()] = list(range(size)) if not present.all() else []
    found = []
    for key, places in groups.items():
        rows: Any = slice(None) if not places else np.array(places)[present[places]]
        cut = {name: np.asarray(values[rows]) for name, values in used.items()}
        found.append(
            Recording(
                label=" ".join(key) or None,
                **{name: values for name, values in cut.items() if not _head(name)},
                heads=MappingProxyType(
                    {n: v for name, v in sorted(cut.items()) if (n := _head(name))}
                ),
                file=file,
                source=source,
            )
        )
    return found


def _head(name: str) -> int:
    number = name.removeprefix("head")
    return int(number) if name.startswith("head") and number.isdigit() else 0
