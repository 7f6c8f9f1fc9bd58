"""What a log with columns of unknown roles seems to hold, judged by their names."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from ...formats.formats import format_of_content
from ...support.layout import counted, laid_out
from ...support.plainresult import PlainResult
from ...support.roles import unit_in_name

#: Words of a name that show its role.
_WORDS: Final = {
    "reference": "reference ref laser tracker true truth polygon interferometer external",
    "indicated": "indicated position pos encoder enc angle actual act measured q theta",
    "velocity": "velocity vel speed qd dq omega",
    "torque": "torque tau effort moment",
    "current": "current amps",
    "temperature": "temperature temp",
    "time": "time t stamp timestamp",
}
_ROLES: Final = {word: role for role, words in _WORDS.items() for word in words.split()}
#: Words that show neither a role nor which joint.
_IDLE: Final = frozenset(
    [
        "joint",
        "joints",
        "j",
        "axis",
        "state",
        "states",
        "deg",
        "rad",
        "turn",
        "count",
        "s",
        "nm",
        "a",
        "c",
    ]
)


class LikelyColumn(NamedTuple):
    """A column and what its name makes likely; ``joint`` is empty where it is of all joints."""

    joint: str
    role: str
    name: str
    unit: str | None


@dataclass(frozen=True)
class LogColumns(PlainResult):
    """What a log is likely to hold, judged by the names of its columns.

    Attributes
    ----------
    file : str
    header : tuple of str
    columns : tuple of LikelyColumn
    """

    file: str
    header: tuple[str, ...]
    columns: tuple[LikelyColumn, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that have a reference and an indicated angle."""
        roles = {(column.joint, column.role) for column in self.columns}
        named = dict.fromkeys(column.joint for column in self.columns if column.joint)
        wanted = ("reference", "indicated")
        return tuple(j for j in named if all((j, role) in roles for role in wanted))

    @property
    def signals(self) -> list[str]:
        """Values of ``--signal`` for these joints; UNIT where a name does not show it."""
        found = []
        for column in self.columns:
            if column.joint in self.joints:
                told = ""
                if column.role in ("reference", "indicated"):
                    in_name = unit_in_name(column.name, column.role)
                    told = "" if in_name else f":{column.unit or 'UNIT'}"
                found.append(f"{column.joint}.{column.role}={column.name}{told}")
        return found

    def to_dict(self) -> dict[str, Any]:
        """The columns by joint, those of all joints, and the values of ``--signal``."""
        joints: dict[str, dict[str, Any]] = {joint: {} for joint in self.joints}
        shared: dict[str, Any] = {}
        for column in self.columns:
            where = shared if not column.joint else joints.get(column.joint)
            if where is not None:
                where[column.role] = {"name": column.name, "unit": column.unit}
        return {
            "file": self.file,
            "columns": list(self.header),
            "joints": joints,
            "shared": shared,
            "signal": self.signals,
            "usable": False,
        }

    def _brief(self) -> str:
        return f"{self.file}, {counted(len(self.joints), 'joint')}: {', '.join(self.joints)}"

    def summary(self) -> str:
        """What the log seems to hold, and the options that declare it."""
        lines = [
            f"{self.file} has {counted(len(self.header), 'column')}; by their names they are of "
            f"{counted(len(self.joints), 'joint')}:"
        ]
        for joint in self.joints:
            own = [f"{c.role} '{c.name}'" for c in self.columns if c.joint == joint]
            lines.append(f"  {joint}: {', '.join(own)}")
        shared = [f"{c.role} '{c.name}'" for c in self.columns if not c.joint]
        if shared:
            lines.append(f"  all joints: {', '.join(shared)}")
        lines += ["", "If that is so, state it, as here or in a robot file (--robot):"]
        lines += [f"  --signal {shlex.quote(text)}" for text in self.signals]
        if any(text.endswith(":UNIT") for text in self.signals):
            lines.append("with deg, rad, turn or count in place of UNIT")
        return laid_out(lines)


def columns_of_log(path: str | Path, topic: str | None = None) -> LogColumns | None:
    """The likely columns of a log by their names; None where they indicate no joint.

    A word of the name shows the role (``laser``, ``pos``, ``tau`` ...), its other words the joint:
    ``elbow_laser`` and ``elbow_pos`` belong together, as ``laser3 [deg]`` and ``q3`` do. A name
    without such a word is an indicated angle where its joint has no other.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "arm.csv"
    >>> _ = log.write_text("t,laser1 [deg],q1,laser2 [deg],q2" + chr(10) + "0,1,2,3,4" + chr(10))
    >>> columns_of_log(log).joints
    ('joint1', 'joint2')
    """
    file = Path(path)
    kind = format_of_content(file)
    header = kind.module.columns(file, topic)
    found = LogColumns(str(path), tuple(header), tuple(_likely(header, kind.unit)))
    return found if found.joints else None


def _likely(header: Sequence[str], unit: str | None) -> list[LikelyColumn]:
    columns: list[LikelyColumn] = []
    unnamed: list[tuple[str, str]] = []
    for name in header:
        words = _words(name)
        roles = [_ROLES[word] for word in words if word in _ROLES]
        joint = _joint([word for word in words if word not in _ROLES and word not in _IDLE])
        if not roles:
            unnamed.append((joint, name))
            continue
        # A word for a reference decides: the angle of a laser is not that of an encoder.
        role = "reference" if "reference" in roles else roles[-1]
        columns.append(LikelyColumn(joint, role, name, unit_in_name(name, role) or unit))
    taken = {(column.joint, column.role) for column in columns}
    for joint, name in unnamed:
        if joint and (joint, "indicated") not in taken:
            taken.add((joint, "indicated"))
            said = unit_in_name(name, "indicated") or unit
            columns.append(LikelyColumn(joint, "indicated", name, said))
    first: dict[tuple[str, str], LikelyColumn] = {}
    for column in columns:
        first.setdefault((column.joint, column.role), column)
    return list(first.values())


def _words(name: str) -> list[str]:
    """Words and numbers of a name, without what is in brackets."""
    bare = re.sub(r"[\[(][^\])]*[\])]", " ", name)
    parted = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    return [word.lower() for word in re.findall(r"[^\W\d_]+|\d+", parted)]


def _joint(words: list[str]) -> str:
    joined = "_".join(words)
    return f"joint{joined}" if joined.isdecimal() else joined
