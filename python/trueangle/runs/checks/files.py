"""Records of files and tables, read without the trust that runs deserve."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ...formats.columns import offsets_of, unit_in_name
from ..files import read_columns
from ..readings import FileReadings
from ..source import checked_reading
from .record import Record

__all__ = ["read_records"]


def read_records(data: Any, reading: Mapping[str, Any]) -> list[Record]:
    """One record per run of every file or table; time may run backwards.

    Raises
    ------
    FileError
        No table of runs: a missing column, text where a number belongs.
    """
    found: list[Record] = []
    for table in read_columns(data, checked_reading(reading)):
        scale = 360.0 / table.period
        columns = {role: (c.name, c.unit) for role, c in table.table.roles.items()}
        for labels, rows in table.groups:
            signals = {name: values[rows] for name, values in table.signals.items()}
            velocity, mount = signals.get("velocity"), signals.get("mount")
            found.append(
                Record(
                    labels.run or str(len(found) + 1),
                    table.reference[rows] * scale,
                    table.indicated[rows] * scale,
                    rows + 1,
                    signals.get("time"),
                    None if velocity is None else velocity * scale,
                    signals.get("temperature"),
                    signals.get("torque"),
                    None if mount is None else mount * scale,
                    columns,
                    _deviations(table.table),
                    _clocks(table.table),
                )
            )
    return found


def _deviations(table: FileReadings) -> tuple[str, ...]:
    """Columns of numbers in small units of angles, or called so, that nothing was asked of."""
    if offsets_of(table.roles):
        return ()
    used = {column.name for column in table.roles.values()}
    return tuple(
        name
        for name, values in table.columns.items()
        if name not in used and values.dtype != object and _is_deviation(name)
    )


def _clocks(table: FileReadings) -> tuple[str, ...]:
    """Columns that are called like a time, where none is known to be one."""
    used = {column.name for column in table.roles.values()}
    unused = () if "time" in table.roles else tuple(n for n in table.columns if n not in used)
    return tuple(name for name in unused if _CLOCK.match(name.strip()))


_CLOCK = re.compile(r"(time|timestamp|stamp|t|date)(_?(s|ms|us|ns|iso|utc))?$", re.IGNORECASE)


def _is_deviation(name: str) -> bool:
    small = unit_in_name(name, "reference_offset") in ("arcsec", "arcmin")
    return small or re.search("deviation|autocoll", name, re.IGNORECASE) is not None
