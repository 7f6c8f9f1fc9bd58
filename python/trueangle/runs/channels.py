"""Two angles in one file that were logged one after the other: they are joined by their times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..support.arrays import Array
from ..support.roles import RoleColumn

if TYPE_CHECKING:
    from .readings import FileReadings


def two_channels(
    table: FileReadings, counts: Mapping[str, float | None], reference: Array, indicated: Array
) -> str:
    """The command that joins two angles with rows of their own; empty for others.

    ``counts`` are those of a turn, by the option that states them.
    """
    both = np.isfinite(reference) & np.isfinite(indicated)
    roles = table.roles
    if both.any() or not {"reference", "indicated", "time"} <= roles.keys():
        return ""
    import shlex

    words = ["trueangle", "join", str(table.path), str(table.path), "-o", "joined.csv"]
    for role, log in (("indicated", "a."), ("reference", "b."), ("time", "")):
        if log or roles[role].is_asked:
            words += ["--signal", f"{log}{role}={_typed(roles[role])}"]
    for option, count in counts.items():
        if count is not None:
            words += [option, f"{count:.17g}"]
    return f": the two angles have rows of their own; run: {shlex.join(words)}"


def _typed(column: RoleColumn) -> str:
    """A column as the option --signal has it."""
    unit = f":{column.unit}" if column.unit else ""
    return f"{'-' if column.is_reversed else ''}{column.name}{unit}"
