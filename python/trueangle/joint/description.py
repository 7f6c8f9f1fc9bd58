"""What a robot file states: the joints of a robot, their gears and the columns of their signals."""

from __future__ import annotations

import json
import math
import xml.parsers.expat
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from xml.etree import ElementTree

from ..errors import ArgumentError, FileError
from ..joint import FIXED_MEMBERS
from ..support.decoding import Decoder, read_text, shown_value, toml_value
from ..support.files import SIMULATION, SIMULATION_BYTES, written_atomically
from ..support.roles import role_kind
from ..support.suggestions import did_you_mean

#: Joints of one robot, at most.
MAX_JOINTS: Final = 256

_ROBOT = {"robot": False, "joint": True}
_NAMED = {"name": False}
_JOINT = {
    "name": True,
    "gear_ratio": False,
    "fixed_member": False,
    "signals": False,
    "shafts": False,
    "simulation": False,
}
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class JointDescription:
    """One joint of a robot file.

    Attributes
    ----------
    name : str
    gear_ratio : float or None
        Motor turns per output turn, negative where the motor turns the other way; None where it
        is not known.
    fixed_member : str
    signals : mapping of role to "COLUMN" or "COLUMN:UNIT"
    shafts : mapping of str to float
        Further shafts and their cycles per output turn.
    simulation : Path or None
    """

    name: str
    gear_ratio: float | None = None
    fixed_member: str = "circular_spline"
    signals: Mapping[str, str] = field(default_factory=dict)
    shafts: Mapping[str, float] = field(default_factory=dict)
    simulation: Path | None = None


@dataclass(frozen=True)
class RobotDescription:
    """A robot and its joints, in the order of their angles.

    Attributes
    ----------
    name : str
    joints : tuple of JointDescription
    """

    name: str
    joints: tuple[JointDescription, ...]

    def only(self, names: list[str] | None) -> RobotDescription:
        """With these joints alone; all of them where none is named.

        Raises
        ------
        ArgumentError
            There is no such joint.
        """
        known = [joint.name for joint in self.joints]
        for name in names or ():
            if name not in known:
                raise ArgumentError(
                    f"no joint {name!r}; the joints are "
                    f"{', '.join(known)}{did_you_mean(name, known)}"
                )
        kept = tuple(joint for joint in self.joints if not names or joint.name in names)
        return RobotDescription(self.name, kept)

    @property
    def text(self) -> str:
        """The robot file."""
        lines = ["[robot]", f"name = {_quoted(self.name)}"]
        for joint in self.joints:
            lines += ["", "[[joint]]", f"name = {_quoted(joint.name)}"]
            if joint.gear_ratio is not None:
                lines.append(f"gear_ratio = {float(joint.gear_ratio)!r}")
            lines.append(f"fixed_member = {_quoted(joint.fixed_member)}")
            if joint.simulation is not None:
                lines.append(f"simulation = {_quoted(str(joint.simulation))}")
            for title, table in (("signals", joint.signals), ("shafts", joint.shafts)):
                if table:
                    lines.append(f"[joint.{title}]")
                    lines += [
                        f"{_key(key)} = {_quoted(v) if isinstance(v, str) else repr(float(v))}"
                        for key, v in table.items()
                    ]
        return "\n".join(lines) + "\n"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the robot file, complete or not at all."""
        with written_atomically(path, kind=SIMULATION) as file:
            file.write(self.text)


def load_description(path: str | PathLike[str]) -> RobotDescription:
    """Read and check a robot file (TOML).

    Raises
    ------
    FileError
        Names the line where the text is not TOML, or the joint and key at fault.
    """
    return description_of_text(path, read_text(path, SIMULATION_BYTES, FileError, "a robot file"))


def description_of_text(path: str | PathLike[str], text: str) -> RobotDescription:
    """The robot that a text (TOML) describes; errors name ``path``."""
    return _DescriptionReader(Path(path)).robot(toml_value(path, text, "a robot file"))


class _DescriptionReader(Decoder):
    """Checks the file key by key."""

    def robot(self, content: Any) -> RobotDescription:
        self.table(content, _ROBOT)
        named = self.table(content.get("robot", {}), _NAMED, "robot")
        entries = self.items(content["joint"], "joint", "[[joint]] tables", MAX_JOINTS)
        joints = tuple(self.joint(entry, f"joint[{i}]") for i, entry in enumerate(entries))
        names = [joint.name for joint in joints]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise self.error(f"two joints are called {name!r}: rename one", f"joint[{i}].name")
        if not joints:
            raise self.error("one [[joint]] at least is needed", "joint")
        return RobotDescription(self.text(named.get("name", ""), "robot.name"), joints)

    def joint(self, entry: Any, at: str) -> JointDescription:
        table = self.table(entry, _JOINT, at)
        name = self.text(table["name"], f"{at}.name")
        if not name or "." in name or "=" in name:
            raise self.error(f"a name without '.' and '=' is needed, got {name!r}", f"{at}.name")
        ratio = None
        if "gear_ratio" in table:
            ratio = self.number(table["gear_ratio"], f"{at}.gear_ratio")
            if ratio == 0.0:
                raise self.error("must not be 0", f"{at}.gear_ratio")
        member = self.text(table.get("fixed_member", "circular_spline"), f"{at}.fixed_member")
        if member not in FIXED_MEMBERS:
            raise self.error(
                f"must be one of {', '.join(FIXED_MEMBERS)}, got {member!r}"
                f"{did_you_mean(member, FIXED_MEMBERS)}",
                f"{at}.fixed_member",
            )
        simulation = table.get("simulation")
        return JointDescription(
            name,
            ratio,
            member,
            self.signals(table.get("signals", _NOTHING), f"{at}.signals"),
            self.shafts(table.get("shafts", _NOTHING), f"{at}.shafts"),
            # Relative to the robot file, wherever the command is called.
            None
            if simulation is None
            else self.path.parent / self.text(simulation, f"{at}.simulation"),
        )

    def signals(self, value: Any, key: str) -> dict[str, str]:
        found = {}
        for role, column in self.named(value, key).items():
            try:
                role_kind(role)
            except ArgumentError as cause:
                raise self.error(str(cause), f"{key}.{role}") from None
            found[role] = self.text(column, f"{key}.{role}")
            if not found[role]:
                raise self.error("the name of a column is needed, got ''", f"{key}.{role}")
        return found

    def shafts(self, value: Any, key: str) -> dict[str, float]:
        found = {}
        for name, cycles in self.named(value, key).items():
            found[name] = self.number(cycles, f"{key}.{name}")
            if not found[name] > 0.0:
                raise self.error(f"must be positive, got {found[name]!r}", f"{key}.{name}")
        return found

    def named(self, value: Any, key: str) -> Mapping[str, Any]:
        if not isinstance(value, Mapping):
            raise self.error(f"a table is needed, got {shown_value(value)}", key)
        return value


def _quoted(text: str) -> str:
    # TOML refuses the one control character that JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if bare else _quoted(name)


#: Joints that turn; others have no angle.
_TURNING = ("revolute", "continuous")


def robot_of_urdf(path: str | PathLike[str]) -> RobotDescription:
    """The robot of a URDF file: its turning joints, in the order of the file.

    ``mechanicalReduction`` of the joint's ``<transmission>`` is its gear ratio, negative
    where the motor turns the other way. The column of a JointState log is the joint's own
    name, in radians; the joint is called so too, with ``_`` for ``.`` and ``=``.

    Raises
    ------
    FileError
        No XML, an entity or document type of its own, no ``<robot>``, no joint that turns, a
        reduction that is not a number, two reductions of one joint, two joints of one name, more
        joints than a robot file has.
    """
    root = _root(path)
    names = [element.get("name") for element in root.findall("joint")]
    ratios: dict[str, float] = {}
    for transmission in root.iter("transmission"):
        driven = transmission.findall("joint")
        for joint in driven:
            name = joint.get("name") or (joint.text or "").strip()
            # The reduction of an actuator is that of the joint, where there is one joint.
            part = transmission if len(driven) == 1 else joint
            for reduction in part.iter("mechanicalReduction"):
                ratio = _ratio(path, name, reduction.text or "")
                # Of two joints of one name that is told.
                if ratios.setdefault(name, ratio) != ratio and names.count(name) == 1:
                    raise FileError(
                        path,
                        f"joint {name!r} has two reductions, {ratios[name]:g} and {ratio:g}: keep "
                        "the one between its motor and its output",
                    )
    joints = []
    for element in root.findall("joint"):
        name, kind = element.get("name", ""), element.get("type", "")
        if kind in _TURNING and name and element.find("mimic") is None:
            geared = ratios.get(name)
            member = "none" if geared is None else "circular_spline"
            # A dot divides joint and role, an equals sign role and column, where one is typed.
            own = name.replace(".", "_").replace("=", "_")
            joints.append(JointDescription(own, geared, member, {"indicated": f"{name}:rad"}))
    if not joints:
        raise FileError(
            path, f"names no joint that turns (type {' or '.join(_TURNING)}, without mimic)"
        )
    # What the file of it would be refused for is refused here.
    return description_of_text(path, RobotDescription(root.get("name", ""), tuple(joints)).text)


def _root(path: str | PathLike[str]) -> ElementTree.Element:
    text = read_text(path, SIMULATION_BYTES, FileError, "a URDF file")

    def refuse(*_: Any) -> None:
        raise FileError(path, "declares a document type; a URDF needs none: take it out")

    # Entities that grow without end are declared in one.
    parser = xml.parsers.expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
        root = ElementTree.fromstring(text)
    except (xml.parsers.expat.ExpatError, ElementTree.ParseError) as cause:
        hint = "; expand xacro first" if "xacro" in text else ""
        raise FileError(path, f"is not XML: {cause}{hint}") from None
    if root.tag != "robot":
        raise FileError(path, f"is not URDF: it begins with <{root.tag}>, not with <robot>")
    return root


def _ratio(path: str | PathLike[str], name: str, text: str) -> float:
    try:
        ratio = float(text)
    except ValueError:
        ratio = math.nan
    if not 0.0 < abs(ratio) < math.inf:
        raise FileError(path, f"joint {name!r}: mechanicalReduction must be a number, got {text!r}")
    return ratio
