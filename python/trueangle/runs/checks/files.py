"""Records of files, read without the trust that runs deserve."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from ..files import read_columns
from .record import Record

__all__ = ["read_records"]


def read_records(paths: Iterable[str | PathLike[str]], **given: Any) -> list[Record]:
    """One record per run and file; time may run backwards. ``given`` as in `read_columns`.

    Raises
    ------
    FileError
        No table of runs: a missing column, text where a number belongs.
    """
    found: list[Record] = []
    for path in paths:
        table = read_columns(Path(path), **given)
        scale = 360.0 / table.period
        columns = {role: (c.name, c.unit) for role, c in table.table.roles.items()}
        for _, label, rows in table.groups:
            signals = {name: values[rows] for name, values in table.signals.items()}
            velocity, mount = signals.get("velocity"), signals.get("mount")
            found.append(
                Record(
                    label or str(len(found) + 1),
                    table.reference[rows] * scale,
                    table.indicated[rows] * scale,
                    rows + 1,
                    signals.get("time"),
                    None if velocity is None else velocity * scale,
                    signals.get("temperature"),
                    signals.get("torque"),
                    None if mount is None else mount * scale,
                    columns,
                )
            )
    return found
