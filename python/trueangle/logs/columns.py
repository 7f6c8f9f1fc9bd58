"""Which column of a log holds the indicated angle of a joint, and in what unit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ..errors import FileError
from ..formats.columns import find_columns, listed_columns, signed_name
from ..model.model import HarmonicModel
from ..support.angles import UNIT_PERIODS, unit_name
from ..support.roles import ANGLE_UNITS, RoleColumn, role_code, unit_in_name
from ..support.signals import SIGNALS
from ..support.suggestions import check_choice, did_you_mean

UNITS = (*UNIT_PERIODS, "count")

#: A column of corrected angles, as `_corrected_name` names it.
_CORRECTED = re.compile(rf"(?:^|[_/])corrected_(?:{'|'.join(UNITS)})(?:_|$)")

#: Column endings of the signals that terms of a model may need.
SIGNAL_COLUMNS = {
    signal.name: tuple(signal.column.format(unit) for unit in UNITS)
    if "{}" in signal.column
    else (signal.column,)
    for signal in SIGNALS.values()
}


class AngleColumn(NamedTuple):
    """The column to correct, its unit, and the column that is added.

    Of a reversed sensor the period is negative: what is added counts as the column does.
    """

    name: str
    unit: str
    period: float
    corrected: str
    assumed: bool = False
    """Whether nobody stated the unit: it is that of the model."""


def find_angle_column(
    path: object,
    model_period: float,
    header: Sequence[str],
    *,
    joint: str | None = None,
    column: str | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    sign: int = 1,
) -> AngleColumn:
    """The indicated angle of ``joint`` among the columns of ``path``.

    Without ``column`` it is the one column ``indicated_deg``, ``_rad``, ``_turn`` or
    ``_count``; for a named joint ``JOINT_indicated_deg``, ``indicated_deg_JOINT``,
    ``JOINT_deg`` or ``JOINT``. Groups of a file are part of the name, with a slash:
    ``JOINT/indicated_deg``. The unit is ``unit``, else the ending of the name, else that of
    the model. A column is what the sensor reads, and of a model with the ``sign`` -1 it is
    reversed, as ``-NAME`` is of any model; one whose own name begins with a minus was reversed
    before.

    Raises
    ------
    FileError
        No such column, or several; counts without ``counts_per_turn``; a column of the
        result's name is there already.
    """
    if unit is not None:
        check_choice("unit", unit, (*ANGLE_UNITS, "count"))
    is_reversed = False
    if column is None:
        column = _search(path, header, joint)
    else:
        column, is_reversed = signed_name(path, header, column)
    if _CORRECTED.search(column):
        raise FileError(
            path,
            "holds corrected angles: name the indicated ones as `column=`; to correct them once "
            "more, rename it",
            line=1,
            column=column,
        )
    stated = unit or _unit_of(column, joint)
    unit = stated or unit_name(model_period)
    period = ANGLE_UNITS.get(unit) or counts_per_turn
    if period is None and unit_name(model_period) == "count":
        period = model_period
    if period is None:
        raise FileError(
            path,
            "counts need their number per output turn: give `counts_per_turn=`",
            line=1,
            column=column,
        )
    corrected = _corrected_name(column, unit, joint)
    if corrected in header:
        raise FileError(
            path, "is there already: this log was corrected before", line=1, column=corrected
        )
    if is_reversed or (sign < 0 and not column.startswith("-")):
        period = -period
    return AngleColumn(column, unit, float(period), corrected, stated is None and period > 0.0)


def find_joint_signal(
    path: object,
    header: Sequence[str],
    signal: str,
    joint: str | None,
    column: tuple[str, str | None] | None,
) -> RoleColumn | None:
    """The column of ``signal`` (velocity, temperature, ...) of ``joint``, or None.

    Without ``column`` it is ``JOINT_velocity_deg_s``, ``velocity_deg_s_JOINT`` or
    ``velocity_deg_s`` and so on, those of the joint first.
    """
    if column is not None:
        name, is_reversed = signed_name(path, header, column[0])
        unit = column[1] or unit_in_name(name, signal)
        return RoleColumn(signal, name, unit, True, is_reversed)
    patterns = (
        ["{}"] if joint is None else [f"{joint}_{{}}", f"{{}}_{joint}", f"{joint}/{{}}", "{}"]
    )
    for pattern in patterns:
        for ending in SIGNAL_COLUMNS.get(signal, (signal,)):
            if pattern.format(ending) in header:
                return RoleColumn(signal, pattern.format(ending), unit_in_name(ending, signal))
    return find_columns(path, header, {}).get(signal) if joint is None else None


def find_channel_columns(
    path: object,
    header: Sequence[str],
    model: HarmonicModel,
    joint: str | None,
    wanted: Mapping[str, tuple[str, str | None]],
) -> tuple[AngleColumn, dict[str, RoleColumn]]:
    """The sine column in place of an angle's, and the other channels among the signals.

    Raises
    ------
    FileError
        A channel is missing; a column of the result's name is there already.
    """
    found = {}
    assert model.channels is not None
    for role in model.channels.roles:
        column = find_joint_signal(path, header, role, joint, wanted.get(role))
        if column is None:
            raise FileError(
                path,
                f"no column {role}, and the model decodes {', '.join(model.channels.roles)}: name "
                f"it with {role_code(role, unit=None)}; {listed_columns(header)}",
                line=1,
            )
        found[role] = column
    unit = unit_name(model.period)
    corrected = _corrected_name("", unit, joint)
    if corrected in header:
        raise FileError(
            path, "is there already: this log was corrected before", line=1, column=corrected
        )
    sine = found.pop("sine").name
    return AngleColumn(sine, unit, model.period, corrected), found


def _search(path: object, header: Sequence[str], joint: str | None) -> str:
    if joint is None:
        wanted = {f"indicated_{unit}" for unit in UNITS}
        found = [name for name in header if name.rpartition("/")[2].removeprefix("-") in wanted]
        if len(found) == 1:
            return found[0]
        problem = (
            f"several indicated columns ({', '.join(found)})"
            if found
            else "no indicated_deg (_rad, _turn, _count) column"
        )
        guesses = (did_you_mean(name, header) for name in sorted(wanted) if not found)
        guess = next(filter(None, guesses), "")
        raise FileError(
            path,
            f"{problem}: name the angle's column with `column=`; {listed_columns(header)}{guess}",
            line=1,
        )
    for candidates in _joint_names(joint):
        found = [name for name in candidates if name in header]
        if len(found) == 1:
            return found[0]
        if found:
            raise FileError(
                path,
                f"several columns of joint {joint} ({', '.join(found)}): name one with "
                f"`column={{{joint!r}: 'NAME'}}`",
                line=1,
            )
    raise FileError(
        path,
        f"no column of joint {joint}, such as {joint}_indicated_deg: name it with "
        f"`column={{{joint!r}: 'NAME'}}`; {listed_columns(header)}",
        line=1,
    )


def _joint_names(joint: str) -> Iterator[list[str]]:
    """Names that the angle of a joint may have, the most specific first."""
    indicated = [f"indicated_{unit}" for unit in UNITS]
    yield [
        name
        for ending in indicated
        for name in (f"{joint}_{ending}", f"{ending}_{joint}", f"{joint}/{ending}")
    ]
    yield [f"{joint}_{unit}" for unit in UNITS]
    yield [joint]


def _unit_of(column: str, joint: str | None) -> str | None:
    if column.endswith(("]", ")")):
        return unit_in_name(column, "indicated")
    name = column.rpartition("/")[2]
    ending = name.rpartition("_")[2]
    if ending not in UNITS and joint is not None:
        ending = name.removesuffix(f"_{joint}").rpartition("_")[2]
    return ending if ending in UNITS else None


def _corrected_name(column: str, unit: str, joint: str | None) -> str:
    group, slash, name = column.rpartition("/")
    if "indicated" in name:
        corrected = name.replace("indicated", "corrected", 1)
    elif joint is not None:
        corrected = f"{joint}_corrected_{unit}"
    else:
        corrected = f"corrected_{unit}"
    return group + slash + corrected
