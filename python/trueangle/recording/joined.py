"""Two sources on one clock: the reference of one at the times of the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..runs.joining.stream import Stream
from ..support.arrays import Array
from ..support.roles import ANGLE_UNITS
from .arrivals import Rows
from .columns import Column

#: Readings of the reference that are kept, and seconds that a reading waits for a later one.
_KEPT, _PATIENCE = 4096, 2.0


class Paired(NamedTuple):
    """Rows that have a reference, in degrees, and how many have none."""

    rows: Rows
    reference: Array
    lost: int


class PairedSources:
    """The reference between its readings by lines, at the arrival of each reading of the other.

    As `trueangle.runs.joining.join` does for one clock; nothing is made up over gaps.

    Parameters
    ----------
    columns : list of Column
        Those of the source of the reference.

    Raises
    ------
    ArgumentError
        It has no reference, or one in counts of unknown number.
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        units = {f"reference_{unit}": turn for unit, turn in ANGLE_UNITS.items()}
        found = [column for column in columns if column.name in units]
        if not found:
            raise ArgumentError(
                "of two sources one needs an indicated angle, the other a reference; name others "
                'with `signals={"a": {"indicated": ("NAME", "UNIT")}, "b": {"reference": '
                '("NAME", "UNIT")}}`, and give `counts_per_turn_reference=` where it counts'
            )
        self._column, self._degrees = found[0], 360.0 / units[found[0].name]
        self._time, self._angle = np.empty(0), np.empty(0)
        self._waiting: Rows | None = None

    def know(self, rows: Rows) -> None:
        """Take in readings of the reference."""
        angle = self._column.values(rows) * self._degrees
        self._time = np.concatenate([self._time, rows.time])[-_KEPT:]
        self._angle = np.concatenate([self._angle, angle])[-_KEPT:]

    def pair(self, rows: Rows | None, now: float) -> Paired | None:
        """Rows whose reference is known by now, those that waited first."""
        if rows is not None and rows.texts:
            self._waiting = rows if self._waiting is None else _both(self._waiting, rows)
        waiting = self._waiting
        if waiting is None:
            return None
        latest = self._time[-1] if self._time.size else -np.inf
        count = int(np.searchsorted(waiting.time, max(latest, now - _PATIENCE), side="right"))
        if not count:
            return None
        ready, rest = _part(waiting, slice(count)), _part(waiting, slice(count, None))
        self._waiting = rest if rest.texts else None
        known = np.zeros(count, dtype=bool)
        angle = np.zeros(count)
        if self._time.size > 2:
            stream = Stream.of(self._time, self._angle)
            known = stream.covers(ready.time)
            angle[known] = stream.at(ready.time[known], cubic=False)[0]
        return Paired(_part(ready, known), angle[known], int(np.count_nonzero(~known)))


def _part(rows: Rows, which: slice | NDArray[np.bool_]) -> Rows:
    if isinstance(which, slice):
        return Rows(rows.texts[which], rows.values[which], rows.time[which])
    texts = [row for row, kept in zip(rows.texts, which.tolist(), strict=True) if kept]
    return Rows(texts, rows.values[which], rows.time[which])


def _both(a: Rows, b: Rows) -> Rows:
    return Rows(
        a.texts + b.texts, np.vstack([a.values, b.values]), np.concatenate([a.time, b.time])
    )
