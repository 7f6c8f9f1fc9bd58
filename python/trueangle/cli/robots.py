"""Commands about a robot: the joints that are meant, the model of one, the table in front."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import ArgumentError, NoModelError, NotInvertibleError, RankError, TrueAngleError
from ..support.plainresult import json_text
from ..support.suggestions import did_you_mean
from .options import errors_in
from .parser import declare
from .signal_options import of_joint, signal_option, signals_by_joint

if TYPE_CHECKING:
    from ..model.model import HarmonicModel

T = TypeVar("T")

#: The name before a role that means the log of a simulator, not a joint.
_SIMULATED = "simulated"


class JointAsked:
    """One joint of a command: its name, the command's arguments as for it alone.

    ``signals`` are its columns by role.
    """

    def __init__(self, name: str, args: argparse.Namespace) -> None:
        self.name = name
        self.args = args

    @property
    def signals(self) -> dict[str, Any]:
        """Columns by role that a correction reads, as a robot's file keeps them."""
        from ..support.signals import is_run_time_signal

        read = ("indicated", "time")
        entries = [e for e in self.args.signal or () if e[0] is None]
        own = [e for e in entries if e[1] in read or is_run_time_signal(e[1])]
        return signals_by_joint(own) or {}


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that name joints."""
    from .parser import Input

    declare(
        parser,
        "--robot FILE",
        Input,
        "robot file (TOML) with the gear and the columns of every joint: the command is "
        "about each of them; `trueangle robot` writes one. --signal JOINT.ROLE=NAME does as well",
    )
    declare(
        parser, "--joint NAME", str, "only this joint of the robot (may be repeated)", many=True
    )


def joints_asked(args: argparse.Namespace) -> tuple[str, list[JointAsked]] | None:
    """The robot's name and the joints that were requested; None where the log is of one joint.

    Raises
    ------
    ArgumentError
        A joint that there is not; an option for what the robot file states itself.
    """
    entries = list(args.signal or ())
    named = list(dict.fromkeys(e[0] for e in entries if e[0] not in (None, _SIMULATED)))
    if args.robot is None and not named:
        if args.joint:
            raise ArgumentError(
                "--joint needs a file of several joints: add --robot FILE, or name their columns "
                "with --signal JOINT.ROLE=NAME"
            )
        return None
    from ..joint.description import JointDescription, RobotDescription, load_description

    if args.robot is None:
        robot = RobotDescription("", tuple(JointDescription(name) for name in named))
    else:
        robot = load_description(args.robot)
        for option in ("gear_ratio", "fixed_member", "shaft", "simulation"):
            if getattr(args, option, None) not in (None, [], "circular_spline"):
                raise ArgumentError(
                    f"--{option.replace('_', '-')} with --robot: the robot file states it of every "
                    "joint; leave it out"
                )
        RobotDescription("", robot.joints).only(named)  # columns of joints that are there
    angles = _indicated(robot, entries)
    robot = robot.only(args.joint)
    return robot.name, [_asked(joint, args, entries, angles) for joint in robot.joints]


def _indicated(robot: Any, entries: list[Any]) -> dict[str, Any]:
    """The column of every joint's indicated angle, where it is named."""
    found = {}
    for joint in robot.joints:
        if "indicated" in joint.signals:
            found[joint.name] = signal_option(f"indicated={joint.signals['indicated']}")
    return found | {e[0]: e for e in entries if e[0] is not None and e[1] == "indicated"}


def _asked(
    joint: Any, args: argparse.Namespace, entries: list[Any], angles: dict[str, Any]
) -> JointAsked:
    """The arguments as for this joint alone: what was typed overrides what the file states.

    What is typed for this joint overrides what is typed for all. The angles of the others
    are signals that it may be coupled to.
    """
    from ..support.signals import COUPLED

    own = {_key(e): e for e in entries if e[0] == joint.name}
    for entry in entries:
        if entry[0] is None:
            own.setdefault(_key(entry), entry)
    for role, column in joint.signals.items():
        own.setdefault(role, signal_option(f"{role}={column}"))
    for other, entry in angles.items():
        if other != joint.name:
            own.setdefault(COUPLED + other, type(entry)((None, COUPLED + other, *entry[2:])))
    signals = [type(e)((None, *e[1:])) for e in own.values()]
    signals += [e for e in entries if e[0] == _SIMULATED]
    new: dict[str, Any] = {"signal": signals, "robot": None, "joint": None, "of_joint": joint.name}
    if args.robot is not None:
        new |= {
            "gear_ratio": joint.gear_ratio,
            "fixed_member": joint.fixed_member,
            "shaft": [f"{name}={cycles!r}" for name, cycles in joint.shafts.items()] or None,
            "simulation": None if joint.simulation is None else str(joint.simulation),
        }
    return JointAsked(joint.name, argparse.Namespace(**{**vars(args), **new}))


def _key(entry: Any) -> str:
    """The role of a column; of offsets of the reference there may be several."""
    role, name = entry[1], entry[2]
    return f"{role} {name}" if role == "reference_offset" else str(role)


def each_joint(
    joints: list[JointAsked], work: Callable[[JointAsked], T]
) -> tuple[dict[str, T], dict[str, TrueAngleError]]:
    """What ``work`` makes of every joint, and of which joints the readings support nothing.

    Raises
    ------
    ArgumentError
        The one of a joint, with its name before it.
    """
    from ..runs.readings import reading_files_once

    found: dict[str, T] = {}
    failed: dict[str, TrueAngleError] = {}
    with reading_files_once():
        for joint in joints:
            try:
                found[joint.name] = work(joint)
            except (NoModelError, RankError, NotInvertibleError) as error:
                print(f"trueangle: warning: joint {joint.name}: {error}", file=sys.stderr)
                failed[joint.name] = error
            except ArgumentError as error:
                if type(error) is not ArgumentError:
                    raise
                told = of_joint(str(error), joint.name)
                raise ArgumentError(f"joint {joint.name}: {told}") from None
    if not found:
        raise NoModelError("; ".join(f"joint {joint}: {error}" for joint, error in failed.items()))
    return found, failed


def save_models(
    path: str, name: str, joints: list[JointAsked], models: Mapping[str, HarmonicModel]
) -> None:
    """One file of the models of a robot's joints, with the columns that each was fitted to."""
    from ..model.robot import Robot

    signals = {joint.name: joint.signals for joint in joints if joint.name in models}
    Robot(dict(models), name=name, signals=signals).save(path)


def show_joints(
    args: argparse.Namespace,
    found: Mapping[str, Any],
    ranks: Iterable[Any] = (),
    title: str = "",
    saved: str | None = None,
    told: Callable[[str], str] | None = None,
) -> None:
    """Print what was found of every joint, the worst first where they are ranked.

    ``told`` prints one joint; by default its summary is printed.
    """
    from ..reports.robot import plain_ranking, ranked, ranking_text

    ranking = ranked(ranks)
    if args.json:
        joints = {joint: result.to_dict() for joint, result in found.items()}
        more = {"model": saved, "joints": joints, "ranking": plain_ranking(ranking) or None}
        print(json_text({name: value for name, value in more.items() if value is not None}))
        return
    unit = errors_in(args)
    parts = [ranking_text(f"{title}, the worst joint first:", ranking, unit)] if ranking else []
    for joint in [row.joint for row in ranking] or found:
        if joint in found:
            text = found[joint].summary(unit) if told is None else told(joint)
            parts.append(f"--- {joint} ---\n{text}")
    print("\n\n".join(parts), flush=True)
    if saved is not None:
        print(f"\nsaved {saved}")


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
    from ..model.robot import is_robot_file

    if joint is not None and not any(map(is_robot_file, paths)):
        raise ArgumentError(f"--joint {joint}: {paths[0]} is the model of one joint; omit --joint")


def joint_asked(path: str, joint: str | None) -> tuple[HarmonicModel, dict[str, Any]]:
    """`model_asked`, and the columns by role to which a robot's joint was fitted.

    Raises
    ------
    ArgumentError
        The file holds several joints and none is named, or one that it does not have.
    """
    from ..model.file import load_model
    from ..model.robot import is_robot_file, load_robot

    if not is_robot_file(path):
        return load_model(path), {}
    robot = load_robot(path)
    if joint is None and len(robot) == 1:
        (joint,) = robot
    known = ", ".join(robot)
    if joint is None:
        raise ArgumentError(f"{path} holds the models of {known}: name one with --joint NAME")
    if joint not in robot:
        raise ArgumentError(
            f"--joint {joint}: {path} holds the models of {known}{did_you_mean(joint, list(robot))}"
        )
    return robot[joint], dict(robot.signals.get(joint, {}))
