"""What is written of a source's columns: under the names that every command finds by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import FileError
from ..formats.columns import find_columns
from ..support.angles import UNIT_PERIODS
from ..support.arrays import Array
from ..support.roles import ANGLES, RoleColumn, role_code, role_kind, wanted_columns
from ..support.signals import find_signal
from .arrivals import Rows

#: Of the angles that are written where their unit is no unit of runs.
_PERIOD = 360.0


class Column(NamedTuple):
    """A column that is written: its name, its place in the rows, and ``factor · x + offset``."""

    name: str
    place: int
    factor: float = 1.0
    offset: float = 0.0

    def values(self, rows: Rows) -> Array:
        """As numbers."""
        return rows.values[:, self.place] * self.factor + self.offset

    def texts(self, rows: Rows) -> list[bytes]:
        """As cells: those that came, where nothing is converted."""
        if self.factor == 1.0 and self.offset == 0.0:
            return [row[self.place] for row in rows.texts]
        return [b"%r" % value for value in self.values(rows).tolist()]


class Counts(NamedTuple):
    """Counts of a turn, of the indicated angle and of the reference."""

    indicated: float | None = None
    reference: float | None = None


def written_columns(
    source: str, names: Sequence[str], signals: Mapping[str, Any] | None, counts: Counts
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
        _column(source, place, name, by_name[name], counts)
        if name in by_name
        else Column(name, place)
        for place, name in enumerate(names)
    ]


def _column(source: str, place: int, name: str, role: RoleColumn, counts: Counts) -> Column:
    kind = role_kind(role.role)
    if kind == "label" or role.role.startswith("reference_offset"):
        return Column(f"device_{name}" if name == "run" else name, place)
    if kind == "time":
        return Column("time_s", place, *role.scale(_PERIOD))
    if kind == "plain":
        return Column(find_signal(role.role).column, place, *role.scale(_PERIOD))
    if role.unit is None:
        raise FileError(
            source,
            f"its unit is not known; give it: {role_code(role.role, name, 'count')}",
            column=name,
        )
    unit = role.unit.removesuffix("/s")
    number = counts.reference if role.role == "reference" else counts.indicated
    known = unit in UNIT_PERIODS or (unit == "count" and number is None)
    keeps = known or (role.role == "error" and unit != "count")
    pattern = f"{role.role}_{{}}" if role.role in ANGLES else find_signal(role.role).column
    # As runs of a reversed sensor are written: minus what the sensor reads.
    minus = "-" if role.sign < 0 and role.role == "indicated" else ""
    sign = -1.0 if role.is_reversed else 1.0
    return Column(
        minus + pattern.format(unit if keeps else "deg"),
        place,
        sign if keeps else role.scale(_PERIOD, number)[0],
    )
