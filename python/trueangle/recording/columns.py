"""What is written of sources: under the names that every command finds, two on one clock."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..errors import ArgumentError, FileError
from ..formats.columns import find_columns
from ..support.angles import UNIT_PERIODS
from ..support.arrays import Array
from ..support.roles import ANGLES, LABELS, RoleColumn, role_code, role_kind, wanted_columns
from ..support.signals import find_signal
from .arrivals import Arrivals, Rows

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
