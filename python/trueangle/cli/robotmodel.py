"""The model that a command takes from a file, which may be that of a whole robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean

if TYPE_CHECKING:
    from ..model.model import HarmonicModel


def model_asked(path: str, joint: str | None = None) -> HarmonicModel:
    """The model of a file, or that of one joint of a robot's file; errors as `joint_asked`."""
    return joint_asked(path, joint)[0]


def refuse_joint(joint: str | None, paths: Sequence[str]) -> None:
    """Refuse the name of a joint where no file is that of a robot.

    Raises
    ------
    ArgumentError
        Every file holds the model of one joint, which has no name.
    """
    from ..model.robotfile import is_robot_file

    if joint is not None and not any(map(is_robot_file, paths)):
        raise ArgumentError(f"--joint {joint}: {paths[0]} is the model of one joint")


def joint_asked(path: str, joint: str | None) -> tuple[HarmonicModel, dict[str, Any]]:
    """`model_asked`, and the columns by role to which a robot's joint was fitted.

    Raises
    ------
    ArgumentError
        The file holds several joints and none is named, or one that it does not have.
    """
    from ..model.file import load_model
    from ..model.robotfile import is_robot_file, load_robot

    if not is_robot_file(path):
        return load_model(path), {}
    robot = load_robot(path)
    if joint is None and len(robot) == 1:
        (joint,) = robot
    known = ", ".join(robot)
    if joint is None:
        raise ArgumentError(f"{path} holds the models of {known}: say which with --joint NAME")
    if joint not in robot:
        raise ArgumentError(
            f"--joint {joint}: {path} holds the models of {known}{did_you_mean(joint, list(robot))}"
        )
    return robot[joint], dict(robot.signals.get(joint, {}))
