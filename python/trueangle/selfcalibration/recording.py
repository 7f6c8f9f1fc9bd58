"""What a log holds for self-calibration, per run or clamping: times, readings, shifts, facets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError, NoModelError
from ..formats.columns import channels_code, listed_columns
from ..runs.channelangle import demodulated
from ..runs.rawchannels import TRACKS
from ..runs.readings import FileReadings
from ..runs.run import CalibrationRun, runs_or_data
from ..runs.source import ReadingOptions, checked_reading_options, each_table, given_periods
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.files import InputFile
from ..support.roles import LABELS, RoleColumn, role_code, role_kind

_LABELS = ("unit", "run")

#: Roles of columns that a recording keeps, in addition to the heads.
_CHANNELS = (
    "time",
    "indicated",
    "reference",
    "motor",
    "shift",
    "mount",
    "current",
    "temperature",
    *TRACKS,
)

#: Shifts that differ by less (radians) are one shift.
_APART: Final = math.radians(0.5)

#: Readings of a polygon lie on its facets within this share of their pitch.
_MOST_FACETS: Final = 720


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
    sine2: Array | None = None
    cosine2: Array | None = None
    periods: int = 1
    periods2: int | None = None
    excitation_deg: float | None = None
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

    @property
    def tracks(self) -> list[Array]:
        """Sine and cosine, with a second track sine2 and cosine2 too.

        Raises
        ------
        NoModelError
            One is missing.
        """
        found: list[Array] = []
        for role in TRACKS[: 2 if self.periods2 is None else 4]:
            values = getattr(self, role)
            if values is None:
                code = role_code(role, unit=None)
                raise NoModelError(f"{self.named}: no column {role}: record it, or name it: {code}")
            found.append(values)
        return found


def track_readings(recordings: Sequence[Recording]) -> list[Array]:
    """Sine and cosine of all recordings, with a second track sine2 and cosine2 too.

    Raises
    ------
    NoModelError
        One is missing.
    """
    return [np.concatenate(track) for track in zip(*(r.tracks for r in recordings), strict=True)]


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

    second = None if run.channels is None else run.channels.second
    tracks: dict[str, Any] = {role: run.signal(role) for role in TRACKS}
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
        **tracks,
        periods=1 if run.channels is None else run.channels.periods_per_turn,
        periods2=None if second is None else second.periods_per_turn,
        file=run.source.file if run.source else "",
        source=run.source,
        indicated_sign=run.indicated_sign,
    )


def _of_table(table: FileReadings, reading: ReadingOptions) -> list[Recording]:
    table, excitation = demodulated(table)
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
    angles = {"indicated", "motor", "head1"} & channels.keys()
    if not (angles or {"sine", "cosine"} <= channels.keys()):
        names = list(table.columns)
        named = channels_code(names) or "`signals={'sine': 'NAME', 'cosine': 'NAME'}`"
        raise FileError(
            table.path,
            "no column indicated_deg (or _rad, _turn, _count), head1_deg, motor_deg, or sine and "
            "cosine: name an angle with `signals={'indicated': ('NAME', 'deg')}`, channels with "
            f"{named}; {listed_columns(names)}",
            line=1,
        )
    labels = [table.columns[table.roles[role].name] for role in _LABELS if role in table.roles]
    file = str(table.path) if table.format.module_name else ""  # none of a table in memory
    read = (table.roles[role] for role in ("indicated", "head1") if role in table.roles)
    sign = next((column.sign for column in read), 1)
    found = _split(channels, labels, file, table.source, sign)
    periods = given_periods(reading) or (1,)
    second = periods[1] if len(periods) > 1 else None
    return [
        replace(recording, periods=periods[0], periods2=second, excitation_deg=excitation)
        for recording in found
    ]


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
        raise ArgumentError(f"{file or 'the table'} has no known column; name its columns")
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


@dataclass(frozen=True)
class Clampings:
    """Readings of all mounts, radians: joint, other scale, shift of each run."""

    joint: list[Array]
    other: list[Array]
    shift: Array
    facets: int  # 0 for an encoder
    notes: tuple[str, ...]


def clampings_of(recordings: Sequence[Recording]) -> Clampings:
    """Readings on both scales, one run a clamping.

    Raises
    ------
    NoModelError
        One reading only, or clampings that are all at one shift.
    """
    first = recordings[0]
    for r in recordings:
        if r.indicated is None or r.reference is None:
            raise NoModelError(
                f"{r.named}: two readings are needed, indicated_deg and reference_deg (the other "
                "encoder, or the polygon's nominal angles)"
            )
    if len(recordings) < 2:
        raise NoModelError(
            f"{first.named}: one clamping shows only the sum of both patterns; record at least "
            "two (three are better), each as a separate run with its shift_deg"
        )
    joint = [np.asarray(r.indicated) for r in recordings]
    other = [np.asarray(r.reference) for r in recordings]
    told = [r.shift if r.shift is not None else r.mount for r in recordings]
    gap = np.array(
        [float(np.angle(np.exp(1j * (b - a)).mean())) for a, b in zip(joint, other, strict=True)]
    )
    gap = np.asarray(wrap(gap - gap[0]))
    notes: list[str] = []
    if any(t is None for t in told):
        shift = gap
        if np.abs(wrap(gap)).max() < _APART:
            raise NoModelError(
                f"{first.named}: all clampings are at one angle, which shows the sum of both "
                "patterns only; turn one of the two between runs and record by how much (shift_deg)"
            )
        notes.append("the shifts are estimated from the mean differences of the two readings")
        return Clampings(joint, other, shift, _facets(other), tuple(notes))
    given = np.array([float(np.angle(np.exp(1j * np.asarray(t)).mean())) for t in told])
    given = np.asarray(wrap(given - given[0]))
    if np.abs(given).max() < _APART and np.abs(gap).max() < _APART:
        raise NoModelError(
            f"{first.named}: all clampings have one shift, which shows the sum of both patterns "
            "only; turn one of the two between runs"
        )
    follows = min(float(np.abs(wrap(gap - s * given)).max()) for s in (1.0, -1.0))
    still = float(np.abs(gap).max())
    if still < follows:
        # Both readings were set to one zero at every clamping: the place on the other scale
        # is its reading and the shift.
        raw = np.array([float(np.asarray(t).mean()) for t in told])
        other = [b + s for b, s in zip(other, raw, strict=True)]
        shift = given
    else:
        shift = gap
        if follows > math.radians(2.0):
            notes.append(
                f"the readings' differences deviate from shift_deg by up to "
                f"{math.degrees(follows):.3g} deg: the differences are used"
            )
    return Clampings(joint, other, shift, _facets(other), tuple(notes))


def _facets(other: Sequence[Array]) -> int:
    """Facets of a polygon, if the readings lie at a few equal steps of the turn; else 0."""
    places = np.mod(np.concatenate(list(other)), 2.0 * math.pi)
    offset = float(np.angle(np.exp(1j * places[:1]).mean()))
    x = np.mod(places - offset, 2.0 * math.pi) / (2.0 * math.pi)
    steps = np.unique(np.round(x * 36_000.0) % 36_000)
    if steps.size > min(_MOST_FACETS, x.size // 2):
        return 0
    for n in range(max(2, steps.size), _MOST_FACETS + 1):
        if (
            float(np.abs(x * n - np.round(x * n)).max()) < 0.1
            and np.unique(np.round(x * n) % n).size >= 0.8 * n
        ):
            return n
    return 0
