"""Readings of a resolver: sine and cosine over its excitation, one of each of its periods."""

from __future__ import annotations

import math

import numpy as np

from .. import _core
from ..errors import FileError
from ..support.roles import LABELS
from .readings import FileReadings


def demodulated(table: FileReadings) -> tuple[FileReadings, float | None]:
    """A row for each period of the excitation, and the phase of the channels against it, degrees.

    Other columns are those of the reading in the middle of the period. A table without excitation
    is as it was.

    Raises
    ------
    FileError
        An empty cell; no periods of four readings and more.
    """
    roles = table.roles
    if not {"sine", "cosine", "excitation"} <= roles.keys():
        return table, None
    columns = [roles[role] for role in ("excitation", "sine", "cosine")]
    carrier, sine, cosine = values = [table.raw(column) for column in columns]
    for column, channel in zip(columns, values, strict=True):
        if not np.isfinite(channel).all():
            row = int(np.flatnonzero(~np.isfinite(channel))[0])
            problem = "a period of the excitation needs all its readings, and this cell is empty"
            raise table.error(problem, column.name, row)
    changes = np.zeros(values[0].size, dtype=bool)
    for role in LABELS:
        if role in roles:
            label = table.columns[roles[role].name]
            changes[1:] |= label[1:] != label[:-1]
    phase, rows, channels = None, [], []
    for part in np.split(np.arange(changes.size), np.flatnonzero(changes)):
        found = _core.demodulate(carrier[part], sine[part], cosine[part], phase)
        if found is None:
            raise FileError(
                table.path,
                f"column {columns[0].name!r} has no periods of 4 readings and more, as an "
                "excitation has: sample it faster, or leave its role out",
                line=1,
            )
        starts, phase = found[0].astype(np.intp), found[3]
        rows.append(part[(starts[:-1] + starts[1:] - 1) // 2])
        channels.append(np.array(found[1:3]))
    middle = np.concatenate(rows)
    kept = {name: column[middle] for name, column in table.columns.items()}
    names = [column.name for column in columns[1:]]
    kept |= dict(zip(names, np.hstack(channels), strict=True))
    others = {role: column for role, column in roles.items() if role != "excitation"}
    return table._replace(columns=kept, roles=others), math.degrees(phase or 0.0)
