"""Which column of a log holds the indicated angle, and in what unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..angles import UNIT_PERIODS, unit_name
from ..errors import FileError

__all__ = ["UNITS", "AngleColumn", "find_angle_column"]

UNITS = (*UNIT_PERIODS, "count")


class AngleColumn(NamedTuple):
    """The column to correct, its unit, and the column that is added."""

    name: str
    unit: str
    period: float
    corrected: str


def find_angle_column(
    path: object,
    model_period: float,
    header: Sequence[str],
    *,
    column: str | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
) -> AngleColumn:
    """The indicated angle among the columns of ``path``.

    Without ``column`` the one column ``indicated_deg``, ``_rad``, ``_turn`` or ``_count``;
    its unit is ``unit``, else the ending of its name, else that of the model.

    Raises
    ------
    FileError
        No such column, or several; counts without ``counts_per_turn``; a column of the
        result's name is there already.
    """
    if column is None:
        found = [name for name in header if name in {f"indicated_{unit}" for unit in UNITS}]
        if len(found) != 1:
            problem = (
                "no indicated_deg (_rad, _turn, _count) column"
                if not found
                else (f"several indicated columns ({', '.join(found)})")
            )
            raise FileError(
                path,
                f"{problem}: name the angle with --column; its columns are {', '.join(header)}",
                line=1,
            )
        column = found[0]
    elif column not in header:
        raise FileError(
            path, f"no such column; its columns are {', '.join(header)}", line=1, column=column
        )
    ending = column.rpartition("_")[2]
    unit = unit or (ending if ending in UNITS else unit_name(model_period))
    period = UNIT_PERIODS.get(unit) or counts_per_turn
    if period is None and unit_name(model_period) == "count":
        period = model_period
    if period is None:
        raise FileError(
            path,
            "counts need their number per output turn: give --counts-per-turn",
            line=1,
            column=column,
        )
    corrected = f"corrected_{unit}"
    if corrected in header:
        raise FileError(
            path, "is there already: this log was corrected before", line=1, column=corrected
        )
    return AngleColumn(column, unit, float(period), corrected)
