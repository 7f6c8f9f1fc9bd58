"""Which column of a table has which role: tolerant names, units by name, bracket or option."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Iterator, Sequence

from ..errors import FileError, UnreadColumnWarning, level_of_caller
from ..support.angles import UNIT_PERIODS
from ..support.roles import (
    ANGLE_UNITS,
    ANGLES,
    BRACKET,
    LABELS,
    TIME_UNITS,
    RoleColumn,
    Wanted,
    role_code,
    role_kind,
    unit_in_name,
    unknown_unit,
    wanted_unit,
)
from ..support.signals import SIGNALS, find_signal


def matching_column(path: object, header: Sequence[str], name: str) -> str:
    """The column called ``name``: exactly, else without case and blanks, else without a unit.

    Raises
    ------
    FileError
        No column matches, or several do; the message names similar ones.
    """
    if name in header:
        return name
    for plain in (_plain, _bare):
        found = [column for column in header if plain(column) == plain(name)]
        if len(found) == 1:
            return found[0]
        if found:
            raise FileError(
                path, f"several columns may be meant ({', '.join(found)})", line=1, column=name
            )
    by_plain = {plain(column): column for plain in (_plain, _bare) for column in header}
    import difflib

    near = difflib.get_close_matches(_plain(name), by_plain, 1)
    hint = f"; did you mean {by_plain[near[0]]!r}?" if near else ""
    raise FileError(path, f"no such column; {listed_columns(header)}{hint}", line=1, column=name)


def signed_name(path: object, header: Sequence[str], name: str) -> tuple[str, bool]:
    """The column that ``name`` means, and whether it is reversed: ``-pos`` is minus ``pos``.

    Raises
    ------
    FileError
        As `matching_column`.
    """
    is_reversed = name.startswith("-") and len(name) > 1 and name not in header
    return matching_column(path, header, name[1:] if is_reversed else name), is_reversed


def find_columns(path: object, header: Sequence[str], wanted: Wanted) -> dict[str, RoleColumn]:
    """The column of every role that a table has: as requested, else by its name.

    Raises
    ------
    FileError
        A column that was requested is missing; two have the same role.
    """
    found = {}
    for role, (name, unit) in wanted.items():
        of_unit, _, ending = name.rpartition(":")
        if name not in header and of_unit in header:
            raise FileError(path, unknown_unit(ending, role), line=1, column=of_unit)
        column, is_reversed = signed_name(path, header, name)
        found[role] = RoleColumn(
            role, column, unit or unit_in_name(column, role), True, is_reversed
        )
    taken = {column.name for column in found.values()}
    heads = {name.partition("_")[0].lower() for name in header if _HEAD.match(name.lower())}
    for role in ("reference", "indicated", "error", *LABELS, *SIGNALS, *sorted(heads)):
        # An error replaces one of the two angles.
        if role in found or (role == "error" and ("reference" in found) == ("indicated" in found)):
            continue
        candidates = [c for c in _by_name(header, role) if c.name not in taken]
        if len(candidates) > 1:
            names = " and ".join(c.name for c in candidates)
            first = role_code(role, candidates[0].name, None)
            problem = f"{len(candidates)} columns for the role {role}: {names}; choose one: {first}"
            raise FileError(path, problem, line=1, column=candidates[1].name)
        if candidates:
            found[role] = candidates[0]
    return found


def warn_of_unread(path: object, names: Sequence[str], roles: Collection[str]) -> None:
    """Report columns that hold neither numbers nor text and have the name of a role.

    ``names`` are those of such columns, ``roles`` are filled by others.
    """
    for role in (*LABELS, *SIGNALS):  # where an angle is missing that is an error
        for column in () if role in roles else _by_name(names, role):
            warnings.warn(
                f"{path}: column {column.name!r} is ignored: it holds neither numbers nor text; "
                f"write it as one of them to use it as the role {role}, or rename it",
                UnreadColumnWarning,
                stacklevel=level_of_caller(),
            )


_HEAD = re.compile(r"head[1-9][0-9]?(_| *[\[(])")


def _by_name(header: Sequence[str], role: str) -> list[RoleColumn]:
    """Columns whose own name states the role."""
    if role in LABELS:
        return [RoleColumn(role, name, None) for name in header if name == role]
    names = dict(_standard(role))
    if role == "indicated":  # as runs of a reversed sensor are written
        names |= {f"-{name}": unit for name, unit in names.items()}
    exact = [RoleColumn(role, name, names[name]) for name in header if name in names]
    if exact:
        # One clock in several units is one clock, and its seconds are taken.
        return exact if role != "time" else [min(exact, key=lambda c: list(names).index(c.name))]
    found = []
    plain = {_plain(name): unit for name, unit in names.items()}
    for name in header:
        bracket = BRACKET.match(name)
        if _plain(name) in plain:
            found.append(RoleColumn(role, name, plain[_plain(name)]))
        elif bracket is not None and _plain(bracket[1]) == role:
            unit = wanted_unit(bracket[2], role)
            if unit is not None:
                found.append(RoleColumn(role, name, unit))
    return found


def _standard(role: str) -> Iterator[tuple[str, str | None]]:
    """Names that columns of a role have, and the unit each states."""
    kind = role_kind(role)
    pattern = f"{role}_{{}}" if role in ANGLES else find_signal(role).column
    if kind == "angle":
        for unit in ANGLE_UNITS if role == "error" else (*UNIT_PERIODS, "count"):
            yield pattern.format(unit), unit
    elif kind == "velocity":
        for unit in (*UNIT_PERIODS, "count"):
            yield pattern.format(unit), f"{unit}/s"
    elif kind == "time":
        for unit in TIME_UNITS:
            yield f"{role}_{unit}", unit
    else:
        yield pattern, None


def listed_columns(header: Sequence[str]) -> str:
    """The columns there are, for a message."""
    if not header:
        return "it has no column of numbers or texts, one to a reading"
    shown = ", ".join(header[:20])
    return f"its columns are {shown}" + (f" and {len(header) - 20} more" if header[20:] else "")


def channels_code(header: Sequence[str]) -> str:
    """How columns whose names hold "sin" and "cos" are named as channels, in Python; else empty."""
    cosine = [name for name in header if re.search("[ck]os", name.lower())]
    sine = [name for name in header if "sin" in name.lower() and name not in cosine]
    if len(sine) != 1 or len(cosine) != 1:
        return ""
    return f"`signals={{'sine': {sine[0]!r}, 'cosine': {cosine[0]!r}}}`"


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _bare(name: str) -> str:
    bracket = BRACKET.match(name)
    return _plain(name if bracket is None else bracket[1])
