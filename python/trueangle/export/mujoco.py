"""MuJoCo: a fragment of MJCF with MuJoCo's own effects, and the model for the others."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import Any, ClassVar
from xml.sax.saxutils import quoteattr

from ..errors import ArgumentError, FileError
from ..model.file import embedded_model
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.writing import model_text
from ..support.files import FileKind
from .pattern import TurnPattern
from .proof import Proof
from .target import CommentBlock, Made, Option, TablePart, Target

#: Of the text element that holds the model of a joint, before the joint's name.
TEXT_NAME = "trueangle:"

#: Of the number that is the noise of its encoder, radians, before the joint's name.
NOISE_NAME = "trueangle_noise:"

_OF_THE_JOINT = ("frictionloss", "damping", "stiffness", "armature")


class MuJoCo(Target):
    """Target ``mujoco``: a file that ``<include>`` takes."""

    name = "mujoco"
    what = "a fragment of MJCF: the sensor's model, friction, damping and torque ripple of a joint"
    kind: ClassVar[FileKind] = FileKind("a fragment of MJCF (XML)", (".xml", ".mjcf", ".txt"))
    sign = "add"
    argument = "reference"
    arithmetic_known = False
    at_sensor = False  # the error is put on MuJoCo's angle of the joint
    options = {
        "joint": Option(str, "joint", "name of the joint in MuJoCo"),
        "frictionloss": Option(float, None, "dry friction, Nm"),
        "damping": Option(float, None, "Nm s/rad"),
        "stiffness": Option(float, None, "of a spring to the zero, Nm/rad"),
        "armature": Option(float, None, "inertia of the rotor at the joint, kg m^2"),
        "noise_std": Option(float, None, "white noise of the encoder, standard deviation in rad"),
        "ripple": Option(str, None, "torque ripple: ORDER:Nm:DEG,... of Nm sin(ORDER angle + DEG)"),
    }

    def holds(self, term: Term) -> bool:
        return True

    def may_be_empty(self, options: Mapping[str, Any]) -> bool:
        """A ripple, friction or noise alone."""
        own = (*_OF_THE_JOINT, "ripple", "noise_std")
        return any(options[key] is not None for key in own)

    def how(self, proof: Proof) -> str:
        return "the model itself is in the file, and SensorLayer evaluates it"

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        model = pattern.source
        joint = options["joint"]
        for key in (*_OF_THE_JOINT, "noise_std"):
            if options[key] is not None and options[key] < 0.0:
                raise ArgumentError(f"{key} must be 0 or more, got {options[key]:g}")
        waves = _ripple(options["ripple"])

        def text(header: CommentBlock) -> str:
            own = [
                f"Joint {joint}: put <include file='...'/> into the model, after <compiler>.",
                "The text element holds the sensor's error, which MuJoCo has no element for: "
                "trueangle.simulators.mujoco.SensorLayer(mjmodel).read(data) puts it on the "
                "joint's angle.",
            ]
            given = [key for key in _OF_THE_JOINT if options[key] is not None]
            if given:
                own.append(f'Give the joint class="trueangle_{joint}": its {", ".join(given)}.')
            if waves:
                own.append(
                    "The dcmotor actuators are the torque ripple, Nm sin(order angle + phase); "
                    "they take no control."
                )
            comment = "\n".join(header.comment("    ", *own)).replace("--", "- -")
            parts = ["<mujoco>", f"  <!--\n{comment}\n  -->"]
            compact = json.dumps(json.loads(model_text(model)), separators=(",", ":"))
            noise = ""
            if options["noise_std"]:
                noise = (
                    f"    <numeric name={quoteattr(NOISE_NAME + joint)} "
                    f'data="{options["noise_std"]!r}"/>\n'
                )
            parts.append(
                f"  <custom>\n    <text name={quoteattr(TEXT_NAME + joint)} "
                f"data={quoteattr(compact)}/>\n{noise}  </custom>"
            )
            if given:
                values = " ".join(f'{key}="{options[key]!r}"' for key in given)
                parts.append(
                    f"  <default>\n    <default class={quoteattr('trueangle_' + joint)}>\n"
                    f"      <joint {values}/>\n    </default>\n  </default>"
                )
            if waves:
                rows = [
                    f"    <dcmotor name={quoteattr(f'trueangle_{joint}_{k}')} "
                    f'joint={quoteattr(joint)} input="none" resistance="1" motorconst="0" '
                    f'cogging="{size!r} {order} {phase!r}"/>'
                    for k, (order, size, phase) in enumerate(waves)
                ]
                parts.append("  <actuator>\n" + "\n".join(rows) + "\n  </actuator>")
            return "\n".join([*parts, "</mujoco>", ""])

        return Made(
            text=text,
            entries=0,
            bytes=0,
            part=TablePart.at_readings(
                pattern, lambda places: pattern.taken_off(places / 2.0**32), zero=0.0
            ),
            floor_arcsec=0.0,
            bits=12,
            lost=list,
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise FileError(path, f"is not XML: {error}", line=error.position[0]) from None
        found = {
            str(element.get("name"))[len(TEXT_NAME) :]: str(element.get("data"))
            for element in root.iter("text")
            if str(element.get("name")).startswith(TEXT_NAME)
        }
        joint = options["joint"]
        if len(found) == 1 and joint not in found:
            joint = next(iter(found))
        if joint not in found:
            raise FileError(
                path, f"holds no model of joint {joint!r}; it has {', '.join(found) or 'none'}"
            )
        return embedded_model(found[joint], path)


def _ripple(text: str | None) -> list[tuple[int, float, float]]:
    """``(order, Nm, radians)`` of each wave."""
    rows = []
    for part in (text or "").split(","):
        if not part.strip():
            continue
        words = part.split(":")
        try:
            order, size, phase = int(words[0]), float(words[1]), float(words[2])
            if len(words) != 3 or order < 1 or not all(map(math.isfinite, (size, phase))):
                raise ValueError
        except (ValueError, IndexError):
            raise ArgumentError(
                f"ripple must be ORDER:Nm:DEG,... with whole orders, got {part.strip()!r}"
            ) from None
        rows.append((order, size, math.radians(phase)))
    return rows
