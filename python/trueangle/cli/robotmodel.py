"""The model that a command takes from a file, which may be that of a whole robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean

if TYPE_CHECKING:
    from ..model.model import HarmonicModel

__all__ = ["columns_of", "model_asked"]


def model_asked(path: str, joint: str | None = None) -> HarmonicModel:
    """The model of a file, or that of one joint of a robot's file.

    Raises
    ------
    ArgumentError
        The file holds several joints and none is named, or one that it does not have.
    """
    from ..model.file import load_model
    from ..model.robotfile import is_robot_file, load_robot

    if not is_robot_file(path):
        return load_model(path)
    robot = load_robot(path)
    if joint is None and len(robot) == 1:
        (model,) = robot.values()
        return model
    known = ", ".join(robot)
    if joint is None:
        raise ArgumentError(f"{path} holds the models of {known}: say which with --joint NAME")
    if joint not in robot:
        raise ArgumentError(
            f"--joint {joint}: {path} holds the models of {known}{did_you_mean(joint, list(robot))}"
        )
    return robot[joint]


def columns_of(path: str, joint: str | None) -> dict[str, Any]:
    """Columns by role to which the joint of a robot's file was fitted; none of other files."""
    from ..model.robotfile import is_robot_file, load_robot

    if not is_robot_file(path):
        return {}
    robot = load_robot(path)
    name = next(iter(robot)) if joint is None else joint
    return dict(robot.signals.get(name, {}))
