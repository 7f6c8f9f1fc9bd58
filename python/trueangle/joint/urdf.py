"""The joints that a URDF file names, with the ratios of their transmissions."""

from __future__ import annotations

import math
import xml.parsers.expat
from os import PathLike
from typing import Any
from xml.etree import ElementTree

from ..errors import FileError
from ..support.decoding import read_text
from ..support.files import SIMULATION_BYTES
from .description import JointDescription, RobotDescription, description_of_text

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
    ratios: dict[str, float] = {}
    for transmission in root.iter("transmission"):
        driven = transmission.findall("joint")
        for joint in driven:
            name = joint.get("name") or (joint.text or "").strip()
            # The reduction of an actuator is that of the joint, where there is one joint.
            part = transmission if len(driven) == 1 else joint
            for reduction in part.iter("mechanicalReduction"):
                ratio = _ratio(path, name, reduction.text or "")
                if ratios.setdefault(name, ratio) != ratio:
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
