"""Recordings: rows of one or two sources into a file until it is enough, and what is known."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ArgumentError, FileError
from ..formats.columns import find_columns
from ..runs.angles import RunAngles, find_run_angles
from ..support.angles import UNIT_PERIODS, arcsec, wrap
from ..support.arrays import Array
from .arrivals import TICK, Arrivals, Rows
from .columns import Column, Counts, PairedSources, written_columns
from .estimate import Estimate, Travel
from .output import RunsFile
from .sources import SourceOptions, open_source

#: Ratio of two speeds that tell a delay.
_SPEEDS = 1.5
#: Share of lines that are rejected from which on something is wrong with the line.
_LOSSES = 0.01
#: Seconds between two looks for faults, and of silence that is one.
_LOOK, _SILENT = 2.0, 2.0
#: Readings that are looked at for faults, and how few tell nothing.
_LATEST, _LEAST = 4000, 50
#: Part of a turn that one angle moves before the other one is stuck.
_MOVED = 1.0 / 36.0


@dataclass(frozen=True)
class Choices:
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
    faults : dict of str to str
        Faults so far, by name.
    estimate : Estimate or None
        Where both angles are known.
    travel : Travel or None
        Where one angle is known.
    note : str
        Why there is no estimate.
    jitter : float
        Of the times, seconds, where they are those of arrival: the device gives none. Else NaN.
    """

    def __init__(self, arrivals: Mapping[str, Arrivals], file: RunsFile, choices: Choices) -> None:
        self.arrivals, self.file, self._choices = arrivals, file, choices
        self._main, *self._others = arrivals.values()
        self._columns: list[Column] = []
        self._pairs: PairedSources | None = None
        self._angles: RunAngles | None = None
        self._names: list[str] = []
        self._single, self._is_stamped = 0, True
        self._slot, self._last, self._looked = -math.inf, 0.0, 0.0
        self._latest: Array = np.empty((3, 0))
        self.rows, self.faults = 0, dict[str, str]()
        self.estimate: Estimate | None = None
        self.travel: Travel | None = None
        self.period, self.note = 360.0, "no line that is a row has come"

    @property
    def ended(self) -> bool:
        """A source has ended, and what it gave was taken."""
        return any(each.is_over for each in self.arrivals.values()) and not self.is_behind

    @property
    def is_behind(self) -> bool:
        """More has arrived than one `take` takes."""
        return bool(self._names) and any(each.is_behind for each in self.arrivals.values())

    @property
    def unpaired(self) -> int:
        """Readings without a reference at their time."""
        return 0 if self._pairs is None else self._pairs.lost

    @property
    def jitter(self) -> float:
        """See the class."""
        return self._main.jitter if self._is_stamped else math.nan

    @property
    def is_enough(self) -> bool:
        """What it was to go on until is there."""
        if self._choices.until == "orders":
            return self.estimate is not None and self.estimate.is_settled
        is_covered = self.travel is not None and self.travel.is_covered
        return is_covered and self._choices.until == "coverage"

    def take(self, now: float) -> None:
        """Take what has arrived by ``now``, seconds from the start of the recording."""
        known = [each.look() for each in self.arrivals.values()]
        if all(known):
            if not self._names:
                self._begin()
            rows, reference = self._main.take(), None
            if self._pairs is not None:
                rows, reference = self._pairs.pair(rows, self._others[0].take(), now)
            if rows.time.size:
                self._write(rows, reference)
        for each in self.arrivals.values():
            self.file.reject(each.rejected)
            each.rejected = []

    def _begin(self) -> None:
        """Choose the columns, now that those of all sources are known."""
        layouts = [each.layout for each in self.arrivals.values()]
        names = [layout.names for layout in layouts if layout is not None]
        found = [
            written_columns(address, own, self._signals_of(i, names), self._choices.counts)
            for i, (address, own) in enumerate(zip(self.arrivals, names, strict=True))
        ]
        if self._others:
            if not any("indicated_" in column.name for column in found[0]):
                found.reverse()
                self._main, self._others = self._others[0], [self._main]
            self._pairs = PairedSources(found[1])
        self._columns = found[0]
        kept = [column.name for column in self._columns]
        self._is_stamped = "time_s" not in kept
        kept = ["time_s"] * self._is_stamped + kept + ["reference_deg"] * len(self._others)
        twice = [name for name in kept if kept.count(name) > 1]
        if twice:
            raise ArgumentError(f"two columns would be called {twice[0]}: name one with `signals=`")
        self.file.begin(kept)
        self._names = kept
        self._find_angles(self.file.rows.path)

    def _signals_of(self, place: int, names: Sequence[Sequence[str]]) -> dict[str, Any]:
        """Columns by role of one source: of two, each has those that only it has."""
        shared: dict[str, Any] = {**self._choices.signals}
        if len(names) < 2:
            return shared
        own: list[dict[str, Any]] = [shared.pop(source, {}) for source in "ab"]
        for role, wanted in [*shared.items()]:
            name = wanted if isinstance(wanted, str) else str(wanted[0])
            if name.removeprefix("-") in names[1 - place]:
                del shared[role]
        return shared | own[place]

    def _find_angles(self, path: Path) -> None:
        indicated, reference = self._choices.counts
        try:
            self._angles = find_run_angles(
                path,
                self._names,
                find_columns(path, self._names, {}),
                counts_per_turn=indicated,
                counts_per_turn_reference=reference,
            )
            self.period = self._angles.period
            self.estimate = Estimate(self.period)
            self.travel, self.note = self.estimate.travel, ""
        except FileError as error:
            self.note = error.problem
            known = {
                f"{role}_{u}": p
                for role in ("indicated", "reference")
                for u, p in UNIT_PERIODS.items()
            }
            turns = [known.get(name.lstrip("-"), 0.0) for name in self._names]
            if any(turns):  # one angle alone: a shaft that turns
                self.period = next(filter(None, turns))
                self.travel, self._single = Travel(self.period), turns.index(self.period)
            if self._choices.until == "orders" or (self._choices.until and self.travel is None):
                raise

    def _write(self, rows: Rows, reference: Array | None) -> None:
        stamps = [rows.time.round(6)] if self._is_stamped else []
        further = [] if reference is None else [reference]
        values = [*stamps, *(column.values(rows) for column in self._columns), *further]
        table = np.column_stack(values)
        if self._choices.rate is not None:
            slots = np.floor(rows.time * self._choices.rate)
            table = table[np.diff(slots, prepend=self._slot) > 0.0]
            self._slot = float(slots[-1])
        self._last = float(rows.time[-1])
        self.file.add(table)
        self.rows += len(table)
        by_name = dict(zip(self._names, table.T.copy(), strict=True))
        seconds = by_name.get("time_s", np.empty(0))
        if self._angles is not None and self.estimate is not None and len(table):
            first, second = self._angles.values(by_name.__getitem__)
            self.estimate.add(first, second, seconds)
            self._latest = np.hstack([self._latest, [first, second, seconds]])[:, -_LATEST:]
        elif self.travel is not None and len(table):
            self.travel.add(table[:, self._single], seconds)

    def new_faults(self, now: float, at_once: bool = False) -> dict[str, str]:
        """Faults by name that were not there before; looked for every two seconds."""
        if now - self._looked < _LOOK and not at_once:
            return {}
        self._looked = now
        found = self._faults_of_readings()
        gc.collect(0)  # what the look has made; commands keep much before they search it
        rejected = self.file.rejected.lines
        if rejected > max(_LOSSES * (self.rows + rejected), 2.0):
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
        """Those of `check`, in the latest readings, and an angle that stands still."""
        reference, indicated, seconds = self._latest
        if reference.size < _LEAST:
            return {}
        pairs = (("indicated", indicated, reference), ("reference", reference, indicated))
        for name, own, other in pairs:
            still = reference.size - max([0, *(np.flatnonzero(own != own[-1]) + 1)[-1:].tolist()])
            path = np.cumsum(wrap(np.diff(other[-still:]), self.period))
            if np.ptp([0.0, *path]) > _MOVED * self.period:
                says = f"the {name} angle is the same in the last {still} readings"
                return {"stuck": f"{says} while the other one moves; is the sensor connected?"}
        # These take longer to import than all that shows the first reading.
        from ..runs.checks.check import data_faults
        from ..runs.checks.record import records_of
        from ..runs.run import CalibrationRun

        run = CalibrationRun(reference, indicated, period=self.period, time=seconds, label="now")
        return {f.fault: f"{f.says}; {f.mend}" for f in data_faults(records_of([run]))}

    @property
    def missing(self) -> str:
        """What the recording still lacks, in one line; empty where it lacks nothing."""
        if self.travel is None or not self.rows:
            return self.note
        forwards, backwards = self.travel.covered.tolist()
        share = float(self.travel.cells.any(axis=0).mean())
        if not share:
            return "motion: turn it slowly"
        if share < 1.0:
            return f"turn on: {360.0 * share:.0f} of 360 deg are read"
        if self.estimate is None:
            return self.note
        if min(forwards, backwards) < 1.0:
            return f"turn it {'backwards' if forwards > backwards else 'forwards'} as well"
        if not self.estimate.is_settled:
            return "turn on: a further turn changes orders by more than their standard errors"
        slow, fast = self.travel.speeds
        return "turn it at another speed as well" if fast < _SPEEDS * slow else ""

    def to_dict(self, now: float) -> dict[str, Any]:
        """What is known by ``now``, as plain values."""
        travel = self.travel or Travel(self.period)
        estimate = self.estimate or Estimate(self.period)
        forwards, backwards = (360.0 * travel.covered).round(1).tolist()
        return {
            "seconds": round(now, 3),
            "readings": self.rows,
            "rejected": self.file.rejected.lines,
            "unpaired": self.unpaired,
            "run": self.file.label,
            "coverage_deg": {"forwards": forwards, "backwards": backwards},
            "speeds_deg_s": [360.0 * s for s in travel.speeds] if travel.speeds[1] else [],
            "turns_travelled": round(travel.turns, 3),
            **estimate.to_dict(arcsec(1.0, self.period)),
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
        Asked at every look whether the recording is to end.

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
            source = open_source(address, choices.options)
            arrivals[address] = Arrivals(source, choices.options, start)
            stack.callback(arrivals[address].close)
        recording, ended = LiveRecording(arrivals, file, choices), ""
        limited = choices.until is not None or choices.seconds < math.inf
        while not ended:
            now = time.monotonic() - start
            recording.take(now)
            show(recording, now, "")
            if now >= choices.seconds or recording.is_enough:
                ended = "asked"
            elif recording.ended:
                broken = any(each.problem is not None for each in arrivals.values())
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
        raise FileError(
            addresses[0],
            f"no line that is a row has come, {file.rejections}; is it the right baud rate? Give "
            "`pattern=` where lines have another layout",
        )
    return recording, ended
