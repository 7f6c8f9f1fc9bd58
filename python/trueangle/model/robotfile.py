"""The file of a robot: the models of its joints in one JSON object."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import ArgumentError, ModelFileError
from ..joint.description import MAX_JOINTS
from ..support.argumentkinds import told_kinds
from ..support.decoding import Decoder
from .file import model_file_content, model_of_part
from .robot import Robot
from .writing import ROBOT_FORMAT

_KEYS = {"format": True, "version": True, "name": False, "joints": True, "signals": False}


@told_kinds
def load_robot(path: str | PathLike[str]) -> Robot:
    """Read and check the file of a robot's models; nothing in it is executed.

    Raises
    ------
    ModelFileError
        Not JSON, truncated, of a later version, a model that `trueangle.load_model` would
        refuse (its key begins with ``joints.NAME``), or the model of one joint.
    """
    return _RobotReader(Path(path), ModelFileError).robot()


def is_robot_file(path: str | PathLike[str]) -> bool:
    """Whether a file begins as that of a robot does; False of what cannot be read."""
    try:
        with open(path, "rb") as file:
            return f'"{ROBOT_FORMAT}"'.encode() in file.read(256)
    except OSError:
        return False


class _RobotReader(Decoder):
    """Checks the file key by key, every model as a separate file would be."""

    def robot(self) -> Robot:
        content = model_file_content(self.path, ROBOT_FORMAT)
        self.table(content, _KEYS)
        joints = content["joints"]
        if not isinstance(joints, dict) or not 1 <= len(joints) <= MAX_JOINTS:
            raise self.error(f"1 to {MAX_JOINTS} joints by name are needed", "joints")
        models = {
            joint: model_of_part(self.path, entry, f"joints.{joint}")
            for joint, entry in joints.items()
        }
        name = self.text(content.get("name", ""), "name")
        try:
            return Robot(models, name=name, signals=self.signals(content.get("signals")))
        except ArgumentError as cause:
            raise self.error(str(cause), "signals") from None

    def signals(self, value: Any) -> dict[str, dict[str, tuple[str, str | None]]]:
        """Columns by joint and role."""
        found: dict[str, dict[str, tuple[str, str | None]]] = {}
        for joint, columns in self.anything({} if value is None else value, "signals").items():
            key = f"signals.{joint}"
            found[joint] = {}
            for role, column in self.anything(columns, key).items():
                parts = self.items(column, f"{key}.{role}", "a name and a unit", 2)
                if len(parts) != 2:
                    raise self.error("a name and a unit (or null) are needed", f"{key}.{role}")
                unit = None if parts[1] is None else self.text(parts[1], f"{key}.{role}[1]")
                found[joint][role] = (self.text(parts[0], f"{key}.{role}[0]"), unit)
        return found

    def anything(self, value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.error("an object is needed", key)
        return value
