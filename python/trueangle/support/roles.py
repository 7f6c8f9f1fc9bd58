"""Roles of columns: what one is for, the units it may be in, offsets, counts of a turn.

A role is what a column is for: ``reference``, ``indicated``, ``run``, ``unit``, or a signal
of `trueangle.support.signals.SIGNALS`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from .angles import UNIT_PERIODS
from .signals import SIGNALS, find_signal
from .suggestions import did_you_mean

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
    **dict.fromkeys(('"', "\u2033", "''", "arcsecs", "arcseconds", "arc sec"), "arcsec"),
    **dict.fromkeys(("'", "\u2032", "arcmins", "arcminutes", "arc min"), "arcmin"),
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
#: A name and what is in brackets behind it.
BRACKET = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
#: Roles in addition to the angles and the signals.
LABELS: Final = ("run", "unit", "when")
#: Angles, which are not signals; a second offset of the reference is reference_offset2.
ANGLES = ("reference", "indicated", "error")
_OFFSET = re.compile(r"reference_offset[1-9]?[0-9]?")

#: Requested columns: by role, the name and the unit, if it is given.
Wanted: TypeAlias = Mapping[str, tuple[str, str | None]]


class RoleColumn(NamedTuple):
    """A column and what it is.

    Attributes
    ----------
    role, name : str
    unit : str or None
        None where it is unknown.
    is_asked : bool
        It was requested, not found by its name.
    is_reversed : bool
        Its values are taken with the other sign.
    """

    role: str
    name: str
    unit: str | None
    is_asked: bool = False
    is_reversed: bool = False

    @property
    def sign(self) -> int:
        """-1 where the values taken are minus what the sensor reads; a minus in the name is one."""
        return -1 if self.is_reversed or self.name.startswith("-") else 1

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


def role_code(role: str, name: str = "NAME", unit: str | None = "UNIT") -> str:
    """How the column of a role is named, in the Python that messages hold.

    Examples
    --------
    >>> role_code("torque", "tau", None), role_code("reference", "pos act", "rad")
    ("`signals={'torque': 'tau'}`", "`signals={'reference': ('pos act', 'rad')}`")
    """
    column = name if unit is None else (name, unit)
    return f"`signals={{{role!r}: {column!r}}}`"


def turned_code(columns: Mapping[str, tuple[str, str | None]]) -> str:
    """How the indicated angle of these columns is named with the other sign, as `role_code`."""
    name, unit = columns.get("indicated", ("NAME", None))
    return role_code("indicated", name[1:] if name.startswith("-") else f"-{name}", unit)


def role_kind(role: str) -> str:
    """What a role holds: "angle", "velocity", "time", "plain" or "label".

    Raises
    ------
    ArgumentError
        There is no such role; the message suggests similar ones.
    """
    if role in ANGLES or _OFFSET.fullmatch(role):
        return "angle"
    if role in LABELS:
        return "label"
    try:
        return find_signal(role).kind
    except ArgumentError:
        known = [*ANGLES, "reference_offset", *SIGNALS, *LABELS, "head1"]
        raise ArgumentError(
            f"no column has the role {role!r}; roles are "
            f"{', '.join(known)}{did_you_mean(role, known)}"
        ) from None


def wanted_unit(text: str, role: str) -> str | None:
    """The unit that ``text`` names for a role, or None: then it is no unit.

    Examples
    --------
    >>> wanted_unit("rad", "reference"), wanted_unit("RBV", "reference")
    ('rad', None)
    """
    unit = _SPELLINGS.get(text.strip().lower(), text.strip())
    return next((u for u in _units(role) if u == unit or u.lower() == unit.lower()), None)


def unknown_unit(text: str, role: str) -> str:
    """That ``text`` is no unit of a role, and those that are.

    Examples
    --------
    >>> unknown_unit("grad", "time")
    "unit 'grad' is not known; use s, ms, us, ns"
    """
    return f"unit {text!r} is not known; use {', '.join(_units(role)) or 'none'}"


def _units(role: str) -> Sequence[str]:
    units: Mapping[str, Sequence[str]] = {
        "angle": ("deg", "rad", "turn", "count", "arcsec", "arcmin"),
        "time": tuple(TIME_UNITS),
        "velocity": ("deg/s", "rad/s", "turn/s", "count/s"),
    }
    return units.get(role_kind(role), tuple(PLAIN_UNITS.get(role, ())))


def unit_in_name(name: str, role: str) -> str | None:
    """The unit that a column's name states: in brackets, or as its ending.

    Examples
    --------
    >>> [unit_in_name(name, "indicated") for name in ("pos act [rad]", "motor_deg", "x")]
    ['rad', 'deg', None]
    """
    bracket = BRACKET.match(name)
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
                f"signals[{role!r}] must be the name of a column, or a pair (name, unit), "
                f"got {given!r}"
            )
        known = None if unit is None else wanted_unit(unit, role)
        if unit is not None and known is None:
            raise ArgumentError(f"signals[{role!r}]: {unknown_unit(unit, role)}")
        found[role] = (name, known)
    return found


def offsets_of(roles: Mapping[str, RoleColumn]) -> list[RoleColumn]:
    """The columns that are added to the reference."""
    return [column for role, column in roles.items() if _OFFSET.fullmatch(role)]


def checked_count_turn(value: float | None, name: str) -> float | None:
    """A number of counts per turn, checked."""
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise ArgumentError(f"{name} must be positive, got {value!r}")
    return value
