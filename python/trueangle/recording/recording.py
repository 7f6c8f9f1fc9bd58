"""Recordings: rows of one or two sources into the columns of a file until it is enough."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..errors import ArgumentError, FileError
from ..formats.columns import find_columns
from ..runs.angles import find_run_angles
from ..support.angles import UNIT_PERIODS, wrap
from ..support.arrays import Array
from ..support.layout import counted
from ..support.roles import ANGLES, LABELS, RoleColumn, role_code, role_kind, wanted_columns
from ..support.signals import find_signal
from .arrivals import TICK, Arrivals, Rows
from .estimate import Estimate
from .output import RunsFile
from .sources import SourceOptions

#: Counts of a turn, of the indicated angle and of the reference.
Counts: TypeAlias = tuple[float | None, float | None]
#: Of the angles that are written where their unit is no unit of runs.
_PERIOD = 360.0
#: Readings of the reference that are kept, and seconds that a reading waits for a later one.
_KEPT, _PATIENCE = 4096, 2.0


class Column(NamedTuple):
    """A column that is written: its name, its place in the rows, and ``factor · x + offset``.

    ``turn`` is that of an angle of the shaft in its unit, NaN in counts of unknown number, else 0.
    """

    name: str
    place: int
    factor: float = 1.0
    offset: float = 0.0
    turn: float = 0.0

    def values(self, rows: Rows) -> Array:
        """As they are written."""
        return rows.values[:, self.place] * self.factor + self.offset


def written_columns(
    source: str, names: Sequence[str], signals: Mapping[str, Any], counts: Counts
) -> list[Column]:
    """The columns of a source as they are written.

    A column with a role gets the role's name and unit; counts become degrees where their number
    per turn is known, other units that no file of runs has too. The time is in seconds. Columns
    without a role keep their names, and all keep their order.

    Raises
    ------
    FileError
        A column that was requested is missing, or its unit is.
    """
    found = find_columns(source, names, wanted_columns(signals)).values()
    roles = {c.name: c for c in found if c.role not in LABELS and "offset" not in c.role}
    return [
        _column(source, place, roles[name], counts)
        if name in roles
        else Column(f"device_{name}" if name == "run" else name, place)
        for place, name in enumerate(names)
    ]


def _column(source: str, place: int, column: RoleColumn, counts: Counts) -> Column:
    role, kind = column.role, role_kind(column.role)
    pattern = f"{role}_{{}}" if role in ANGLES else find_signal(role).column
    if kind in ("time", "plain"):
        return Column(pattern, place, *column.scale(_PERIOD))
    if column.unit is None:
        problem = f"its unit is not known; give it: {role_code(role, column.name, 'count')}"
        raise FileError(source, problem, column=column.name)
    unit, number = column.unit.removesuffix("/s"), counts[role == "reference"]
    if unit not in UNIT_PERIODS and not (unit == "count" and number is None):
        unit = "deg"
    # As runs of a reversed sensor are written: minus what the sensor reads.
    minus = "-" if column.sign < 0 and role == "indicated" else ""
    factor, offset = column.scale(UNIT_PERIODS.get(unit, _PERIOD), number)
    turn = UNIT_PERIODS.get(unit, math.nan) if role in ANGLES[:2] else 0.0
    return Column(minus + pattern.format(unit), place, factor, offset, turn)


class PairedSources:
    """The reference between its readings by lines, at the arrival of each reading of the other.

    As `trueangle.runs.joining.join` does for one clock; nothing is made up over gaps.

    Parameters
    ----------
    arrivals : Arrivals
        Of the reference.
    columns : list of Column
        Its columns.

    Attributes
    ----------
    lost : int
        Readings without a reference at their time.

    Raises
    ------
    ArgumentError
        It has no reference, or one in counts of unknown number.
    """

    def __init__(self, arrivals: Arrivals, columns: Sequence[Column]) -> None:
        found = [c for c in columns if c.turn > 0.0 and c.name.startswith("reference_")]
        if not found:
            raise ArgumentError(
                "of two sources one needs an indicated angle, the other a reference; name others "
                'with `signals={"a": {"indicated": ("NAME", "UNIT")}, "b": {"reference": '
                '("NAME", "UNIT")}}`, and give `counts_per_turn_reference=` where it counts'
            )
        self._arrivals, self._column, self.lost = arrivals, found[0], 0
        self._known = self._waiting = Rows(np.empty((0, 0)), np.empty(0))

    def pair(self, rows: Rows, now: float) -> tuple[Rows, Array]:
        """Rows whose reference is known by now, those that waited first, and it in degrees."""
        from ..runs.joining.stream import Stream

        self._known = self._known.followed_by(self._arrivals.take()).at(slice(-_KEPT, None))
        rows, time = self._waiting.followed_by(rows), self._known.time
        ready = rows.time <= max([now - _PATIENCE, *time[-1:]])
        rows, self._waiting = rows.at(ready), rows.at(~ready)
        known, angle = np.zeros(rows.time.size, dtype=bool), np.empty(0)
        if time.size > 2 and known.size:
            degrees = self._column.values(self._known) * _PERIOD / self._column.turn
            stream = Stream.of(time, degrees)
            known = stream.covers(rows.time)
            angle = stream.at(rows.time[known], cubic=False)[0]
        self.lost += int(np.count_nonzero(~known))
        return rows.at(known), angle


#: Seconds between two looks for faults, and of silence that is one.
_LOOK, _SILENT = 2.0, 2.0
#: Readings that are looked at for faults, and the fewest that suffice.
_LATEST, _LEAST = 4000, 50
#: Part of a turn that one angle moves before the other one is stuck.
_MOVED = 1.0 / 36.0


class Choices(NamedTuple):
    """What is recorded, and until when.

    Attributes
    ----------
    signals : mapping
        Columns by role; those of one of two sources under ``"a"`` and ``"b"``.
    options : SourceOptions
    counts : tuple of float
        Counts of a turn, of the indicated angle and of the reference.
    rate : float, optional
        Readings per second that are kept at most.
    seconds : float
        After which it ends.
    until : {"orders", "coverage"}, optional
    """

    signals: Mapping[str, Any]
    options: SourceOptions
    counts: Counts = (None, None)
    rate: float | None = None
    seconds: float = math.inf
    until: str | None = None


class LiveRecording:
    """Takes what has arrived, writes it, and adds it to the estimate.

    Parameters
    ----------
    arrivals : mapping of str to Arrivals
        What arrives from each of one or two sources, by its address.
    file : RunsFile
    choices : Choices

    Attributes
    ----------
    rows : int
        Readings written.
    unpaired : int
        Readings without a reference at their time.
    faults : dict of str to str
        Faults so far, by name.
    estimate : Estimate
        Without an error where one angle alone is known; empty where none is.
    note : str
        Why the error is not known; empty where it is.
    """

    def __init__(self, arrivals: Mapping[str, Arrivals], file: RunsFile, choices: Choices) -> None:
        self.arrivals, self.file, self._choices = arrivals, file, choices
        self._main = next(iter(arrivals.values()))
        self._columns: list[Column] = []
        self._pairs: PairedSources | None = None
        self._angles: Callable[[Callable[[str], Array]], tuple[Array, Array]] | None = None
        self._names: list[str] = []
        self._slot, self._last, self._looked = -math.inf, 0.0, 0.0
        self._latest: Array = np.empty((3, 0))
        self.rows, self.unpaired, self.faults = 0, 0, dict[str, str]()
        self.estimate, self.note = Estimate(360.0), "no line that is a row has come"

    @property
    def is_over(self) -> bool:
        """A source has ended, and what it gave was taken."""
        return any(each.is_over for each in self.arrivals.values()) and not self.is_behind

    @property
    def is_behind(self) -> bool:
        """More has arrived than one `take` takes."""
        return bool(self._names) and any(each.is_behind for each in self.arrivals.values())

    @property
    def jitter(self) -> float:
        """Of times of arrival, seconds; NaN where the device gives the time."""
        timed = any(column.name == "time_s" for column in self._columns)
        return math.nan if timed else self._main.jitter

    @property
    def is_enough(self) -> bool:
        """What it was to go on until is there."""
        enough = {"orders": self.estimate.is_settled, "coverage": self.estimate.share == 1.0}
        return enough.get(self._choices.until or "", False)

    def take(self, now: float) -> None:
        """Take what has arrived by ``now``, seconds from the start of the recording."""
        known = [each.look() for each in self.arrivals.values()]
        if all(known):
            if not self._names:
                self._begin()
            rows, further = self._main.take(), list[Array]()
            if self._pairs is not None:
                rows, *further = self._pairs.pair(rows, now)
                self.unpaired = self._pairs.lost
            if rows.time.size:
                self._write(rows, further)
        for each in self.arrivals.values():
            self.file.reject(each.rejected)
            each.rejected = []

    def _begin(self) -> None:
        """Choose the columns, now that those of all sources are known."""
        names = [each.layout.names for each in self.arrivals.values() if each.layout is not None]
        shared: dict[str, Any] = {**self._choices.signals}
        own = [shared.pop(source, {}) for source, _ in zip("ab", names, strict=False)]
        found = []
        for i, (address, each) in enumerate(self.arrivals.items()):
            theirs = names[1 - i] if len(names) > 1 else ()
            # Of two sources each has the columns that only it has.
            signals = {
                role: wanted
                for role, wanted in shared.items()
                if (wanted if isinstance(wanted, str) else wanted[0]).lstrip("-") not in theirs
            }
            columns = written_columns(address, names[i], signals | own[i], self._choices.counts)
            found.append((each, columns))
        found.sort(key=lambda pair: not any("indicated_" in column.name for column in pair[1]))
        (self._main, self._columns), *others = found
        self._pairs = PairedSources(*others[0]) if others else None
        kept = [column.name for column in self._columns]
        kept = ["time_s"] * ("time_s" not in kept) + kept + ["reference_deg"] * len(others)
        twice = [name for name in kept if kept.count(name) > 1]
        if twice:
            raise ArgumentError(f"two columns would be called {twice[0]}: name one with `signals=`")
        self.file.begin(kept)
        self._names, path = kept, self.file.rows.path
        try:
            angles = find_run_angles(path, kept, find_columns(path, kept, {}))
            self._angles, period, self.note = angles.values, angles.period, ""
        except FileError as error:
            self.note = error.problem
            alone = [(column.name, column.turn) for column in self._columns if column.turn]
            if len(alone) == 1 and math.isnan(alone[0][1]):
                alone, self.note = [], "counts need their number per turn: give `counts_per_turn=`"
            if self._choices.until == "orders" or (self._choices.until and not alone):
                raise FileError(path, self.note) from None
            if not alone:
                return
            name, period = alone[0]  # a shaft that turns
            self._angles = lambda get: (get(name), get(name))
        self.estimate = Estimate(period)

    def _write(self, rows: Rows, further: list[Array]) -> None:
        stamps = [rows.time.round(6)] * (self._names[0] != self._columns[0].name)
        table = np.column_stack([*stamps, *(c.values(rows) for c in self._columns), *further])
        if self._choices.rate is not None:
            slots = np.floor(rows.time * self._choices.rate)
            table = table[np.diff(slots, prepend=self._slot) > 0.0]
            self._slot = float(slots[-1])
        self._last = float(rows.time[-1])
        self.file.add(table)
        self.rows += len(table)
        if self._angles is not None and len(table):
            by_name = dict(zip(self._names, table.T.copy(), strict=True))
            readings = np.array([*self._angles(by_name.__getitem__), by_name["time_s"]])
            self.estimate.add(*readings)
            self._latest = np.hstack([self._latest, readings])[:, -_LATEST:]

    def new_faults(self, now: float, at_once: bool = False) -> dict[str, str]:
        """Faults by name that were not there before; looked for every two seconds."""
        if now - self._looked < _LOOK and not at_once:
            return {}
        self._looked = now
        found = self._faults_of_readings()
        gc.collect(0)  # what the look has made; commands keep much before they search it
        rejected = self.file.rejected.lines
        # Share of lines that are rejected from which on something is wrong with the line.
        if rejected > max(0.01 * (self.rows + rejected), 2.0):
            found["rejected_lines"] = (
                f"{rejected} of {self.rows + rejected} lines are no rows "
                f"({self.file.rejected.path}): bytes are lost, the baud rate is another, or lines "
                "have another layout"
            )
        if now - self._last > _SILENT:
            found["silent"] = f"no reading for {_SILENT:g} s: does the device send?"
        new = {name: text for name, text in found.items() if name not in self.faults}
        self.faults |= new
        return new

    def _faults_of_readings(self) -> dict[str, str]:
        """Those of `check`, in the latest readings, and an angle that does not change."""
        reference, indicated, seconds = self._latest
        if reference.size < _LEAST or self.note:
            return {}
        pairs = (("indicated", indicated, reference), ("reference", reference, indicated))
        for name, own, other in pairs:
            still = int(np.argmax(np.append(own[::-1] != own[-1], True)))
            path = np.cumsum(wrap(np.diff(other[-still:]), self.estimate.period))
            if np.ptp([0.0, *path]) > _MOVED * self.estimate.period:
                says = f"the {name} angle is the same in the last {still} readings"
                return {"stuck": f"{says} while the other one moves; is the sensor connected?"}
        # These take longer to import than all that shows the first reading.
        from ..runs.checks.check import data_faults
        from ..runs.checks.record import records_of
        from ..runs.run import CalibrationRun

        run = CalibrationRun(reference, indicated, period=self.estimate.period, time=seconds)
        return {f.fault: f"{f.says}; {f.mend}" for f in data_faults(records_of([run]))}

    @property
    def missing(self) -> str:
        """What the recording still lacks, in one line; empty where it lacks nothing."""
        share, (forwards, backwards) = self.estimate.share, self.estimate.covered.tolist()
        if self._angles is None or not self.rows:
            return self.note
        if not share:
            return "motion: turn it slowly"
        if share < 1.0:
            return f"turn further: {360.0 * share:.0f} of 360 deg are read"
        if self.note:
            return self.note
        if min(forwards, backwards) < 1.0:
            return f"turn it {'backwards' if forwards > backwards else 'forwards'} as well"
        if not self.estimate.is_settled:
            return "turn further: another turn changes orders by more than their standard errors"
        slow, fast = self.estimate.speeds
        # Ratio of two speeds that show a delay.
        return "turn it at another speed as well" if fast < 1.5 * slow else ""

    def to_dict(self, now: float) -> dict[str, Any]:
        """What is known by ``now``, as plain values."""
        return {
            "seconds": round(now, 3),
            "readings": self.rows,
            "rejected": self.file.rejected.lines,
            "unpaired": self.unpaired,
            "run": self.file.label,
            **self.estimate.to_dict(),
            "missing": self.missing,
            "faults": [{"fault": name, "says": says} for name, says in self.faults.items()],
        }


def record(
    addresses: Sequence[str],
    file: RunsFile,
    choices: Choices,
    show: Callable[[LiveRecording, float, str], None],
    stopped: Callable[[], bool] = lambda: False,
) -> tuple[LiveRecording, str]:
    """Record one source, or two that are joined, into a file of runs.

    Parameters
    ----------
    addresses : sequence of str
        See `trueangle.recording.sources.open_source`.
    file : RunsFile
        It holds whole rows at every moment; it is closed at the end.
    choices : Choices
    show : callable
        Shows what is known by a time, and why it has ended, as `Screen.show`.
    stopped : callable
        Called at every look; returns whether the recording is to end.

    Returns
    -------
    LiveRecording
    str
        ``"asked"``, ``"source"`` (before it was asked to end, or by a fault) or ``"stopped"``.

    Raises
    ------
    FileError, ArgumentError
        A source cannot be opened, no row has come, or a column is missing.
    OSError
        A device or disk that fails at the start.
    """
    if len({*addresses}) != len(addresses) or len(addresses) > 2:
        raise ArgumentError(f"one source is recorded, or two are joined; got {len(addresses)}")
    with ExitStack() as stack:
        stack.callback(file.close)
        arrivals, start = dict[str, Arrivals](), time.monotonic()
        for address in addresses:
            arrivals[address] = Arrivals(address, choices.options, start)
            stack.callback(arrivals[address].close)
        recording, ended = LiveRecording(arrivals, file, choices), ""
        while not ended:
            now = time.monotonic() - start
            recording.take(now)
            show(recording, now, "")
            if now >= choices.seconds or recording.is_enough:
                ended = "asked"
            elif recording.is_over:
                broken = any(each.problem is not None for each in arrivals.values())
                limited = choices.until is not None or choices.seconds < math.inf
                ended = "source" if broken or limited else "asked"
            elif stopped():
                ended = "stopped"
            elif not recording.is_behind:
                time.sleep(max(TICK - (time.monotonic() - start - now), 0.001))
        for each in arrivals.values():
            each.close()
        while recording.is_behind:
            recording.take(time.monotonic() - start)
        recording.take(math.inf)  # what still waits for a reference has none
        show(recording, time.monotonic() - start, ended)
    if not recording.rows and ended != "stopped":
        address = next((a for a, each in arrivals.items() if each.layout is None), addresses[0])
        problem = f"no line that is a row has come, {file.rejections}; is it the right baud rate? "
        problem += "Give `pattern=` where lines have another layout"
        if recording.unpaired:
            lost = counted(recording.unpaired, "reading")
            problem = f"{lost} without a reference at their time; do both send at the same time?"
        elif not file.rejected.lines:
            problem = "nothing has come; does it send? `send=` sends a line that it waits for"
        raise FileError(address, problem)
    return recording, ended
