"""A recording: rows of one or two sources into a file, and what is known by now."""

from __future__ import annotations

import gc
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError, FileError
from ..formats.columns import find_columns
from ..runs.angles import RunAngles, find_run_angles
from ..support.angles import UNIT_PERIODS, arcsec
from ..support.arrays import Array
from .arrivals import Arrivals, Rows
from .columns import Column, Counts, written_columns
from .estimate import Estimate, Travel
from .faults import LatestReadings
from .output import RunsFile

if TYPE_CHECKING:
    from .joined import PairedSources

#: Ratio of two speeds that tell a delay.
_SPEEDS = 1.5
#: Share of lines that are rejected from which on something is wrong with the line.
_LOSSES = 0.01
#: Seconds between two looks for faults, and of silence that is one.
_LOOK, _SILENT = 2.0, 2.0


class LiveRecording:
    """Takes what has arrived, writes it, and adds it to the estimate.

    Parameters
    ----------
    addresses : sequence of str
        Of one source or of two.
    arrivals : sequence of Arrivals
        What arrives from each.
    file : RunsFile
    signals : mapping
        Columns by role; those of one of two sources under ``"a"`` and ``"b"``.
    counts : Counts
    rate : float, optional
        Readings per second that are kept at most.
    needs : str, optional
        ``"orders"`` needs both angles, ``"coverage"`` one.

    Attributes
    ----------
    rows, unpaired : int
        Readings written, and those without a reference at their time.
    estimate : Estimate or None
        Where both angles are known.
    travel : Travel or None
        Where one angle is known.
    note : str
        Why there is no estimate.
    is_stamped : bool
        Times are those of arrival: the device gives none.
    main : int
        Which of the sources has the indicated angle.
    """

    def __init__(
        self,
        addresses: Sequence[str],
        arrivals: Sequence[Arrivals],
        file: RunsFile,
        signals: Mapping[str, Any],
        counts: Counts,
        rate: float | None = None,
        needs: str | None = None,
    ) -> None:
        self.addresses, self.arrivals, self.file = addresses, arrivals, file
        self._signals, self._counts = signals, counts
        self._rate, self._needs = rate, needs
        self._columns: list[Column] | None = None
        self.is_stamped = True
        self._single: str | None = None
        self._names: list[str] = []
        self._pairs: PairedSources | None = None
        self._angles: RunAngles | None = None
        self._slot = -math.inf
        self.main, self._last = 0, -math.inf
        self._looked = 0.0
        self._latest: LatestReadings | None = None
        self._told: dict[str, str] = {}
        self.rows = self.unpaired = 0
        self.estimate: Estimate | None = None
        self.travel: Travel | None = None
        self.period, self.note = 360.0, "no line that is a row has come"

    @property
    def ended(self) -> bool:
        """A source has ended, and what it gave was taken."""
        return any(arrival.is_over for arrival in self.arrivals) and not self.is_behind

    @property
    def is_behind(self) -> bool:
        """More has arrived than one `take` takes."""
        return self._columns is not None and any(a.is_behind for a in self.arrivals)

    def take(self, now: float) -> None:
        """Take what has arrived by ``now``, seconds from the start of the recording."""
        known = [arrival.look() for arrival in self.arrivals]
        if all(known):
            if self._columns is None:
                self._begin()
            parts = [arrival.take() for arrival in self.arrivals]
            rows: Rows | None = parts[self.main]
            reference = None
            if self._pairs is not None:
                self._pairs.know(parts[1 - self.main])
                paired = self._pairs.pair(rows, now)
                rows, reference = (paired.rows, paired.reference) if paired else (None, None)
                self.unpaired += paired.lost if paired else 0
            if rows is not None and rows.texts:
                self._write(rows, reference)
        for arrival in self.arrivals:
            rejected, arrival.rejected = arrival.rejected, []
            self.file.reject(rejected)

    def _begin(self) -> None:
        """Choose the columns, now that those of all sources are known."""
        names = [a.layout.names for a in self.arrivals if a.layout is not None]
        found = [
            written_columns(address, names[i], self._signals_of(i, names), self._counts)
            for i, address in enumerate(self.addresses)
        ]
        if len(found) == 2:
            from .joined import PairedSources

            self.main = int(not any("indicated_" in column.name for column in found[0]))
            self._pairs = PairedSources(found[1 - self.main])
        self._columns = found[self.main]
        kept = [column.name for column in self._columns]
        self.is_stamped = "time_s" not in kept
        self._names = ["time_s"] * self.is_stamped + kept + ["reference_deg"] * (len(found) == 2)
        if len(set(self._names)) < len(self._names):
            twice = next(name for name in self._names if self._names.count(name) > 1)
            raise ArgumentError(f"two columns would be called {twice}: name one with `signals=`")
        self.file.begin(self._names)
        self._find_angles()

    def _signals_of(self, place: int, names: Sequence[Sequence[str]]) -> dict[str, Any]:
        """Columns by role of one source: of two, each has those that only it has."""
        shared = {k: v for k, v in self._signals.items() if k not in ("a", "b")}
        other = names[1 - place] if len(names) == 2 else ()
        kept = {k: v for k, v in shared.items() if _name(v) not in other}
        own = self._signals.get("ab"[place]) if len(names) == 2 else None
        return {**kept, **(own or {})}

    def _find_angles(self) -> None:
        path = self.file.rows.path
        roles = find_columns(path, self._names, {})
        try:
            self._angles = find_run_angles(
                path,
                self._names,
                roles,
                counts_per_turn=self._counts.indicated,
                counts_per_turn_reference=self._counts.reference,
            )
            self.period = self._angles.period
            self.estimate = Estimate(self.period)
            self.travel, self.note = self.estimate.travel, ""
            self._latest = LatestReadings(self.period)
        except FileError as error:
            self.note = error.problem
            for name in self._names:  # one angle alone: a shaft that turns
                role, _, unit = name.lstrip("-").partition("_")
                if role in ("indicated", "reference") and unit in UNIT_PERIODS:
                    self._single, self.period = name, UNIT_PERIODS[unit]
                    self.travel = Travel(self.period)
                    break
            if self._needs == "orders" or (self._needs and self.travel is None):
                raise

    def _write(self, rows: Rows, reference: Array | None) -> None:
        assert self._columns is not None
        if self._rate is not None:
            slots = np.floor(rows.time * self._rate)
            kept = np.diff(slots, prepend=self._slot) > 0.0
            self._slot = float(slots[-1])
            texts = [row for row, keeps in zip(rows.texts, kept.tolist(), strict=True) if keeps]
            rows = Rows(texts, rows.values[kept], rows.time[kept])
            reference = None if reference is None else reference[kept]
            if not texts:
                return
        cells = [column.texts(rows) for column in self._columns]
        values = {column.name: column.values(rows) for column in self._columns}
        if self.is_stamped:
            values["time_s"] = rows.time
            cells.insert(0, [b"%.6f" % seconds for seconds in rows.time.tolist()])
        if reference is not None:
            values["reference_deg"] = reference
            cells.append([b"%r" % angle for angle in reference.tolist()])
        self.file.add(cells)
        self.rows += len(rows.texts)
        self._last = float(rows.time[-1])
        if self._angles is not None and self.estimate is not None:
            first, second = self._angles.values(lambda name: values[name])
            self.estimate.add(first, second, values["time_s"])
            if self._latest is not None:
                self._latest.add(first, second, values["time_s"])
        elif self.travel is not None and self._single is not None:
            self.travel.add(values[self._single], values["time_s"])

    def new_faults(self, now: float, at_once: bool = False) -> dict[str, str]:
        """Faults by name that were not there before; looked for every two seconds."""
        if now - self._looked < _LOOK and not at_once:
            return {}
        self._looked = now
        found: dict[str, str] = {}
        if self._latest is not None:
            found = self._latest.look()
            gc.collect(0)  # what the look has made; commands keep much before they search it
        rejected = self.file.rejected.lines
        if rejected > max(_LOSSES * (self.rows + rejected), 2.0):
            what = self.file.rejected.path
            found["rejected_lines"] = (
                f"{rejected} of {self.rows + rejected} lines are no rows ({what}): bytes are lost, "
                "the baud rate is another, or lines have another layout"
            )
        if now - max(self._last, 0.0) > _SILENT:
            found["silent"] = f"no reading for {_SILENT:g} s: does the device send?"
        new = {name: text for name, text in found.items() if name not in self._told}
        self._told |= new
        return new

    @property
    def faults(self) -> dict[str, str]:
        """Faults so far, by name."""
        return self._told

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
        travel, known = self.travel, self.travel is not None and self.rows
        covered = [round(360.0 * x, 1) for x in travel.covered] if travel and known else [0.0, 0.0]
        moved = travel is not None and travel.speeds[1] > 0.0
        orders = {} if self.estimate is None else self.estimate.to_dict(arcsec(1.0, self.period))
        return {
            "seconds": round(now, 3),
            "readings": self.rows,
            "rejected": self.file.rejected.lines,
            "unpaired": self.unpaired,
            "run": self.file.label,
            "coverage_deg": {"forwards": covered[0], "backwards": covered[1]},
            "speeds_deg_s": [360.0 * s for s in travel.speeds] if travel and moved else [],
            "turns_travelled": round(travel.turns, 3) if travel else 0.0,
            **({"turns": 0, "peak_to_peak_arcsec": None, "orders": []} | orders),
            "missing": self.missing,
            "faults": [{"fault": name, "says": says} for name, says in self._told.items()],
        }


def _name(wanted: Any) -> str:
    """The column that is asked for, without the sign of a reversed one."""
    return str(wanted if isinstance(wanted, str) else wanted[0]).removeprefix("-")
