"""Which column of a table holds what: names forgiven, units told by name, bracket or option.

A role is what a column is for: ``reference``, ``indicated``, ``run``, ``unit``, or a signal
of `trueangle.formats.signals.SIGNALS`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..support.angles import UNIT_PERIODS
from ..support.suggestions import did_you_mean
from .signals import SIGNALS, find_signal

__all__ = [
    "ANGLE_UNITS",
    "LABELS",
    "Column",
    "Wanted",
    "count_turn",
    "find_columns",
    "listed_columns",
    "matching_column",
    "offsets_of",
    "role_kind",
    "signal_code",
    "signed_name",
    "unit_in_name",
    "wanted_columns",
    "wanted_unit",
]

#: Turns in the units of angles; counts have no turn of their own.
ANGLE_UNITS: Final[Mapping[str, float]] = {**UNIT_PERIODS, "arcsec": 1_296_000.0, "arcmin": 21600.0}
#: Seconds in the units of time.
TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Factor and offset to the unit of the signal's column.
PLAIN_UNITS: Final[Mapping[str, Mapping[str, tuple[float, float]]]] = {
    "temperature": {"C": (1.0, 0.0), "K": (1.0, -273.15), "F": (5.0 / 9.0, -160.0 / 9.0)},
    "torque": {"Nm": (1.0, 0.0), "mNm": (1e-3, 0.0), "Ncm": (1e-2, 0.0), "kNm": (1e3, 0.0)},
    "current": {"A": (1.0, 0.0), "mA": (1e-3, 0.0)},
}
#: Other spellings of units, in small letters.
_SPELLINGS = {
    **dict.fromkeys(("degree", "degrees", "°", "degs"), "deg"),
    **dict.fromkeys(("radian", "radians", "rads"), "rad"),
    **dict.fromkeys(("turns", "rev", "revs", "revolution", "revolutions"), "turn"),
    **dict.fromkeys(("counts", "cnt", "cts", "inc", "ticks", "lsb"), "count"),
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "milliseconds"), "ms"),
    **dict.fromkeys(("µs", "μs", "usec", "microseconds"), "us"),
    **dict.fromkeys(("nsec", "nanoseconds"), "ns"),
    **dict.fromkeys(("°/s", "deg/sec", "degrees/s", "deg_s"), "deg/s"),
    **dict.fromkeys(("rad/sec", "rad_s"), "rad/s"),
    **dict.fromkeys(("rev/s", "turns/s", "turn_s", "rps"), "turn/s"),
    **dict.fromkeys(("°c", "degc", "c", "celsius"), "C"),
    **dict.fromkeys(("k", "kelvin"), "K"),
    **dict.fromkeys(("°f", "f"), "F"),
    **dict.fromkeys(("nm", "n.m", "n·m", "n m", "n*m"), "Nm"),
    "mnm": "mNm",
    "ncm": "Ncm",
    "knm": "kNm",
    "a": "A",
    "ma": "mA",
}
_BRACKET = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
#: Roles beside the angles and the signals.
LABELS: Final = ("run", "unit", "when")
#: Angles that are no signals; a second thing that is added to the reference is reference_offset2.
_ANGLES = ("reference", "indicated", "error")
_OFFSET = re.compile(r"reference_offset[1-9]?[0-9]?")

#: Columns asked for: by role, the name and the unit where it is told.
Wanted: TypeAlias = Mapping[str, tuple[str, str | None]]


class Column(NamedTuple):
    """A column and what it is.

    Attributes
    ----------
    role, name : str
    unit : str or None
        None where nothing tells it.
    is_asked : bool
        It was named, not found by its name.
    is_reversed : bool
        Its sign is the other one.
    """

    role: str
    name: str
    unit: str | None
    is_asked: bool = False
    is_reversed: bool = False

    def values(
        self, raw: NDArray[Any], period: float, counts_per_turn: float | None = None
    ) -> NDArray[np.float64]:
        """Values in the unit of a run of ``period``, from those of the column."""
        factor, offset = self.scale(period, counts_per_turn)
        numbers = np.asarray(raw, dtype=np.float64)
        if factor == 1.0 and offset == 0.0:
            return numbers
        return numbers * factor + offset

    def scale(self, period: float, counts_per_turn: float | None = None) -> tuple[float, float]:
        """Factor and offset that lead to the unit of a run of ``period``."""
        kind, sign = role_kind(self.role), -1.0 if self.is_reversed else 1.0
        if kind == "time":
            return sign * TIME_UNITS[self.unit or "s"], 0.0
        if kind in ("angle", "velocity"):
            unit = (self.unit or "").removesuffix("/s")
            turn = counts_per_turn if unit == "count" else ANGLE_UNITS.get(unit)
            return sign * (1.0 if turn is None else period / turn), 0.0
        factor, offset = PLAIN_UNITS.get(self.role, {}).get(self.unit or "", (1.0, 0.0))
        return sign * factor, sign * offset


def signal_code(role: str, name: str = "NAME", unit: str | None = "UNIT") -> str:
    """How the column of a role is named, in the Python that messages hold.

    Examples
    --------
    >>> signal_code("torque", "tau", None), signal_code("reference", "pos act", "rad")
    ("`signals={'torque': 'tau'}`", "`signals={'reference': ('pos act', 'rad')}`")
    """
    column = name if unit is None else (name, unit)
    return f"`signals={{{role!r}: {column!r}}}`"


def role_kind(role: str) -> str:
    """What a role holds: "angle", "velocity", "time", "plain" or "label".

    Raises
    ------
    ArgumentError
        There is no such role; says what may be meant.
    """
    if role in _ANGLES or _OFFSET.fullmatch(role):
        return "angle"
    if role in LABELS:
        return "label"
    try:
        return find_signal(role).kind
    except ArgumentError:
        known = [*_ANGLES, "reference_offset", *SIGNALS, *LABELS, "head1"]
        raise ArgumentError(
            f"no column has the role {role!r}{did_you_mean(role, known)}; roles are "
            f"{', '.join(known)}"
        ) from None


def wanted_unit(text: str, role: str) -> str | None:
    """The unit that ``text`` names for a role, or None: then it is no unit.

    Examples
    --------
    >>> wanted_unit("rad", "reference"), wanted_unit("RBV", "reference")
    ('rad', None)
    """
    unit = _SPELLINGS.get(text.strip().lower(), text.strip())
    units: Mapping[str, Sequence[str]] = {
        "angle": (*ANGLE_UNITS, "count"),
        "time": tuple(TIME_UNITS),
        "velocity": ("deg/s", "rad/s", "turn/s", "count/s"),
        "plain": tuple(PLAIN_UNITS.get(role, ())),
        "label": (),
    }
    return next((u for u in units[role_kind(role)] if u == unit or u.lower() == unit.lower()), None)


def unit_in_name(name: str, role: str) -> str | None:
    """The unit that a column's name states: in brackets, or as its ending.

    Examples
    --------
    >>> [unit_in_name(name, "indicated") for name in ("pos act [rad]", "motor_deg", "x")]
    ['rad', 'deg', None]
    """
    bracket = _BRACKET.match(name)
    if bracket is not None:
        return wanted_unit(bracket[2], role)
    base = name.rpartition("/")[2]
    if role_kind(role) == "velocity" and base.endswith("_s"):
        unit = wanted_unit(base.removesuffix("_s").rpartition("_")[2] + "/s", role)
        if unit is not None:
            return unit
    return wanted_unit(base.rpartition("_")[2], role) if "_" in base else None


def wanted_columns(signals: Mapping[str, Any] | None) -> dict[str, tuple[str, str | None]]:
    """Columns by role from ``{"torque": "tau", "reference": ("pos act", "rad")}``.

    Several that are added to the reference come as a list.

    Raises
    ------
    ArgumentError
        A role or unit that there is not.
    """
    found: dict[str, tuple[str, str | None]] = {}
    several = {
        f"{role}{i + 1 if i else ''}": entry
        for role, given in (signals or {}).items()
        for i, entry in enumerate(
            given if role == "reference_offset" and isinstance(given, list) else [given]
        )
    }
    for role, given in several.items():
        role_kind(role)
        name, unit = given if isinstance(given, tuple) and len(given) == 2 else (given, None)
        if not isinstance(name, str) or not (unit is None or isinstance(unit, str)):
            raise ArgumentError(
                f"signals[{role!r}] must be the name of a column, or a pair of it and its unit, "
                f"got {given!r}"
            )
        known = None if unit is None else wanted_unit(unit, role)
        if unit is not None and known is None:
            raise ArgumentError(f"signals[{role!r}]: {unit!r} is not a unit of this role")
        found[role] = (name, known)
    return found


def matching_column(path: object, header: Sequence[str], name: str) -> str:
    """The column called ``name``: exactly, else without case and blanks, else without a unit.

    Raises
    ------
    FileError
        None, or several; says which ones are near.
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
    hint = f"did you mean {by_plain[near[0]]!r}? " if near else ""
    raise FileError(path, f"no such column; {hint}{listed_columns(header)}", line=1, column=name)


def signed_name(path: object, header: Sequence[str], name: str) -> tuple[str, bool]:
    """The column that ``name`` means, and whether it is reversed: ``-pos`` is minus ``pos``.

    Raises
    ------
    FileError
        As `matching_column`.
    """
    is_reversed = name.startswith("-") and len(name) > 1 and name not in header
    return matching_column(path, header, name[1:] if is_reversed else name), is_reversed


def offsets_of(roles: Mapping[str, Column]) -> list[Column]:
    """The columns that are added to the reference."""
    return [column for role, column in roles.items() if _OFFSET.fullmatch(role)]


def find_columns(path: object, header: Sequence[str], wanted: Wanted) -> dict[str, Column]:
    """The columns of every role that a table has: those asked for, the others by their names.

    Raises
    ------
    FileError
        A column that was asked for is missing; two have the same role.
    """
    found = {}
    for role, (name, unit) in wanted.items():
        column, is_reversed = signed_name(path, header, name)
        found[role] = Column(role, column, unit or unit_in_name(column, role), True, is_reversed)
    taken = {column.name for column in found.values()}
    heads = {name.partition("_")[0].lower() for name in header if _HEAD.match(name.lower())}
    for role in ("reference", "indicated", "error", *LABELS, *SIGNALS, *sorted(heads)):
        # An error stands for one of the two angles.
        if role in found or (role == "error" and ("reference" in found) == ("indicated" in found)):
            continue
        candidates = [c for c in _by_name(header, role) if c.name not in taken]
        if len(candidates) > 1:
            names = " and ".join(c.name for c in candidates)
            problem = (
                f"units are mixed: {names}; keep one, or name it with "
                f"{signal_code(role, unit=None)}"
            )
            raise FileError(path, problem, line=1, column=candidates[1].name)
        if candidates:
            found[role] = candidates[0]
    return found


_HEAD = re.compile(r"head[1-9][0-9]?(_| *[\[(])")


def _by_name(header: Sequence[str], role: str) -> list[Column]:
    """Columns whose own name says that they have a role."""
    if role in LABELS:
        return [Column(role, name, None) for name in header if name == role]
    names = dict(_standard(role))
    exact = [Column(role, name, names[name]) for name in header if name in names]
    if exact:
        # One clock in several units is one clock, and its seconds are taken.
        return exact if role != "time" else [min(exact, key=lambda c: list(names).index(c.name))]
    found = []
    plain = {_plain(name): unit for name, unit in names.items()}
    for name in header:
        bracket = _BRACKET.match(name)
        if _plain(name) in plain:
            found.append(Column(role, name, plain[_plain(name)]))
        elif bracket is not None and _plain(bracket[1]) == role:
            unit = wanted_unit(bracket[2], role)
            if unit is not None:
                found.append(Column(role, name, unit))
    return found


def _standard(role: str) -> Iterator[tuple[str, str | None]]:
    """Names that columns of a role have, and the unit each states."""
    kind = role_kind(role)
    pattern = f"{role}_{{}}" if role in _ANGLES else find_signal(role).column
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
    shown = ", ".join(header[:20])
    return f"its columns are {shown}" + (f" and {len(header) - 20} more" if header[20:] else "")


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _bare(name: str) -> str:
    bracket = _BRACKET.match(name)
    return _plain(name if bracket is None else bracket[1])


def count_turn(value: float | None, name: str) -> float | None:
    """A number of counts per turn, checked."""
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise ArgumentError(f"{name} must be positive, got {value!r}")
    return value
