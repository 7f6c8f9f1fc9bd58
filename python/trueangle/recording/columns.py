"""What is written of sources: under the names that every command finds, two on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..errors import ArgumentError, FileError
from ..formats.columns import find_columns
from ..support.angles import UNIT_PERIODS
from ..support.arrays import Array
from ..support.roles import ANGLE_UNITS, ANGLES, RoleColumn, role_code, role_kind, wanted_columns
from ..support.signals import find_signal
from .arrivals import Rows

#: Counts of a turn, of the indicated angle and of the reference.
Counts: TypeAlias = tuple[float | None, float | None]
#: Of the angles that are written where their unit is no unit of runs.
_PERIOD = 360.0
#: Readings of the reference that are kept, and seconds that a reading waits for a later one.
_KEPT, _PATIENCE = 4096, 2.0


class Column(NamedTuple):
    """A column that is written: its name, its place in the rows, and ``factor · x + offset``."""

    name: str
    place: int
    factor: float = 1.0
    offset: float = 0.0

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
        A column that was asked for is missing, or its unit is.
    """
    roles = find_columns(source, names, wanted_columns(signals))
    by_name = {column.name: column for column in roles.values()}
    return [
        _column(source, place, name, by_name.get(name), counts) for place, name in enumerate(names)
    ]


def _column(source: str, place: int, name: str, role: RoleColumn | None, counts: Counts) -> Column:
    kind = "label" if role is None else role_kind(role.role)
    if role is None or kind == "label" or role.role.startswith("reference_offset"):
        return Column(f"device_{name}" if name == "run" else name, place)
    pattern = f"{role.role}_{{}}" if role.role in ANGLES else find_signal(role.role).column
    if kind in ("time", "plain"):
        return Column(pattern, place, *role.scale(_PERIOD))
    if role.unit is None:
        problem = f"its unit is not known; give it: {role_code(role.role, name, 'count')}"
        raise FileError(source, problem, column=name)
    unit = role.unit.removesuffix("/s")
    number = counts[role.role == "reference"]
    known = unit in UNIT_PERIODS or (unit == "count" and number is None)
    keeps = known or (role.role == "error" and unit != "count")
    # As runs of a reversed sensor are written: minus what the sensor reads.
    minus = "-" if role.sign < 0 and role.role == "indicated" else ""
    factor = role.scale(_PERIOD, number)[0]
    if keeps:
        factor = -1.0 if role.is_reversed else 1.0
    return Column(minus + pattern.format(unit if keeps else "deg"), place, factor)


class PairedSources:
    """The reference between its readings by lines, at the arrival of each reading of the other.

    As `trueangle.runs.joining.join` does for one clock; nothing is made up over gaps.

    Parameters
    ----------
    columns : list of Column
        Those of the source of the reference.

    Attributes
    ----------
    lost : int
        Readings without a reference at their time.

    Raises
    ------
    ArgumentError
        It has no reference, or one in counts of unknown number.
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        turns = {f"reference_{unit}": turn for unit, turn in ANGLE_UNITS.items()}
        found = [column for column in columns if column.name in turns]
        if not found:
            raise ArgumentError(
                "of two sources one needs an indicated angle, the other a reference; name others "
                'with `signals={"a": {"indicated": ("NAME", "UNIT")}, "b": {"reference": '
                '("NAME", "UNIT")}}`, and give `counts_per_turn_reference=` where it counts'
            )
        self._column, self._degrees = found[0], 360.0 / turns[found[0].name]
        self._time, self._angle = np.empty(0), np.empty(0)
        self._waiting, self.lost = Rows(np.empty((0, 0)), np.empty(0)), 0

    def pair(self, rows: Rows, reference: Rows, now: float) -> tuple[Rows, Array]:
        """Rows whose reference is known by now, those that waited first, and it in degrees."""
        from ..runs.joining.stream import Stream

        angle = self._column.values(reference) * self._degrees
        self._time = np.append(self._time, reference.time)[-_KEPT:]
        self._angle = np.append(self._angle, angle)[-_KEPT:]
        if self._waiting.time.size:
            rows = Rows(*(np.concatenate(pair) for pair in zip(self._waiting, rows, strict=True)))
        ready = rows.time <= max([now - _PATIENCE, *self._time[-1:]])
        rows, self._waiting = rows.at(ready), rows.at(~ready)
        known, angle = np.zeros(rows.time.size, dtype=bool), np.empty(0)
        if self._time.size > 2 and known.size:
            stream = Stream.of(self._time, self._angle)
            known = stream.covers(rows.time)
            angle = stream.at(rows.time[known], cubic=False)[0]
        self.lost += int(np.count_nonzero(~known))
        return rows.at(known), angle
