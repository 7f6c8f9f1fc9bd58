"""What a log holds for self-calibration: time, the reading, other channels, per run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..runs.readings import FileReadings
from ..runs.run import CalibrationRun, runs_or_data
from ..runs.source import ReadingOptions, checked_reading_options, each_table
from ..support.arrays import Array
from ..support.files import InputFile
from ..support.roles import LABELS, RoleColumn, role_kind

_LABELS = ("unit", "run")

#: Roles of columns that a recording keeps, besides the heads.
_CHANNELS = (
    "time",
    "indicated",
    "reference",
    "motor",
    "shift",
    "mount",
    "current",
    "temperature",
    "sine",
    "cosine",
)


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
    temperature: Array | None = None
    sine: Array | None = None
    cosine: Array | None = None
    periods: int = 1
    file: str = ""
    source: InputFile | None = None
    indicated_sign: int = 1

    def __len__(self) -> int:
        for channel in (
            self.indicated,
            self.motor,
            self.reference,
            self.sine,
            *self.heads.values(),
        ):
            if channel is not None:
                return int(channel.size)
        return 0

    @property
    def named(self) -> str:
        """File and run, for messages."""
        run = f"run {self.label}" if self.label else ""
        return ", ".join(part for part in (self.file, run) if part) or "the log"


def as_recordings(logs: Any, reading: Mapping[str, Any]) -> list[Recording]:
    """Recordings of files, folders, patterns, tables in memory, calibration runs.

    ``reading`` are keywords of `trueangle.read_runs`.

    Raises
    ------
    FileError, ArgumentError
        Files that cannot be read; columns in no known unit, of different lengths.
    """
    asked = checked_reading_options(reading)
    runs, logs = runs_or_data(logs)
    if runs is not None:
        return [_of_run(run) for run in runs]
    parts = each_table(logs, lambda table: _of_table(table, asked), asked, "logs")
    return [recording for part in parts for recording in part]


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
        temperature=run.temperature,
        sine=run.signal("sine"),
        cosine=run.signal("cosine"),
        periods=1 if run.channels is None else run.channels.periods_per_turn,
        file=run.source.file if run.source else "",
        source=run.source,
        indicated_sign=run.indicated_sign,
    )


def _of_table(table: FileReadings, reading: ReadingOptions) -> list[Recording]:
    channels = {
        role: _in_radians(
            column._replace(unit=column.unit or table.format.unit)
            if role_kind(role) == "angle"
            else column,
            table,
            reading,
        )
        for role, column in table.roles.items()
        if role not in LABELS
    }
    if not (
        any(role in channels for role in ("indicated", "motor", "head1"))
        or {"sine", "cosine"} <= channels.keys()
    ):
        raise FileError(
            table.path,
            "no column indicated_deg (or _rad, _turn, _count), head1_deg, motor_deg, or sine and "
            f"cosine; its columns are {', '.join(list(table.columns)[:12])}",
            line=1,
        )
    labels = [table.columns[table.roles[role].name] for role in _LABELS if role in table.roles]
    file = str(table.path) if table.format.module_name else ""  # none of a table in memory
    read = (table.roles[role] for role in ("indicated", "head1") if role in table.roles)
    sign = next((column.sign for column in read), 1)
    found = _split(channels, labels, file, table.source, sign)
    periods = reading["periods_per_turn"] or 1
    return [replace(recording, periods=periods) for recording in found]


def _in_radians(column: RoleColumn, table: FileReadings, reading: ReadingOptions) -> Array:
    """A channel in radians, seconds or the unit of its only column."""
    is_reference = column.role == "reference"
    turn = reading["counts_per_turn_reference" if is_reference else "counts_per_turn"]
    return table.values(column, 2.0 * np.pi, turn)


def _split(
    channels: Mapping[str, Array],
    labels: Sequence[NDArray[Any]],
    file: str,
    source: InputFile,
    indicated_sign: int,
) -> list[Recording]:
    """One recording per unit and run, in the order of their first row, without empty rows."""
    if not channels:
        raise ArgumentError(f"{file or 'the table'} holds no column that is known")
    used = {name: values for name, values in channels.items() if name in _CHANNELS or _head(name)}
    size = next(iter(channels.values())).size
    present = np.ones(size, dtype=bool)
    for name, values in used.items():
        present &= np.isfinite(values) | (name == "temperature")
    groups: dict[tuple[str, ...], list[int]] = {}
    if labels:
        for i, key in enumerate(zip(*(map(str, label) for label in labels), strict=True)):
            groups.setdefault(key, []).append(i)
    else:
        groups[()] = list(range(size)) if not present.all() else []
    found = []
    for key, places in groups.items():
        rows: Any = slice(None) if not places else np.array(places)[present[places]]
        cut: dict[str, Any] = {name: np.asarray(v[rows]) for name, v in used.items()}
        found.append(
            Recording(
                label=" ".join(key) or None,
                **{name: values for name, values in cut.items() if not _head(name)},
                heads=MappingProxyType(
                    {n: v for name, v in sorted(cut.items()) if (n := _head(name))}
                ),
                file=file,
                source=source,
                indicated_sign=indicated_sign,
            )
        )
    return found


def _head(name: str) -> int:
    number = name.removeprefix("head")
    return int(number) if name.startswith("head") and number.isdigit() else 0
