"""The joints of a robot: their models under their names, corrected together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..errors import ArgumentError, KindError, MissingSignalError, ModelFileError
from ..joint.description import MAX_JOINTS
from ..support.angles import arcsec, unit_name
from ..support.argumentkinds import of_type, told_kinds
from ..support.decoding import Decoder
from ..support.layout import counted, laid_out
from ..support.plainresult import ShownResult
from ..support.roles import wanted_columns
from ..support.signals import GivenSignals, check_signal_names, coupled_joint
from .corrector import JointsStep, exchangeable_step
from .file import model_file_content, model_of_part
from .model import HarmonicModel
from .writing import ROBOT_FORMAT, save_robot

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


#: Columns of a log by role, each with its unit where its name does not state it.
Columns: TypeAlias = Mapping[str, tuple[str, str | None]]


@told_kinds
class Robot(ShownResult, Mapping[str, HarmonicModel]):
    """The correction models of a robot's joints, by name, corrected in one call.

    ::

        θ_j = θ_{ind,j} - ε_j(θ_j),    j = 1 ... J

    Parameters
    ----------
    models : mapping of str to HarmonicModel
        In the order of the joints' angles; every model in its own unit.
    name : str
        Of the robot.
    signals : mapping of str to mapping, optional
        The columns of a log that belong to each joint, as ``signals=`` of `trueangle.correct`:
        ``{"elbow": {"indicated": ("q3", "rad")}}``.

    Raises
    ------
    ArgumentError
        No joint, or signals of a joint that is not there.

    Examples
    --------
    >>> from trueangle import Shaft
    >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> robot = Robot({"shoulder": model, "elbow": model})
    >>> robot.joints
    ('shoulder', 'elbow')
    >>> robot.correct([90.5, 0.0]).round(9)
    array([90.,  0.])
    """

    def __init__(
        self,
        models: Mapping[str, HarmonicModel],
        *,
        name: str = "",
        signals: Mapping[str, Any] | None = None,
    ) -> None:
        if not isinstance(models, Mapping):
            raise KindError(f"models must be a mapping of joints to models, got {models!r:.60}")
        if not models:
            raise ArgumentError("models is empty: a robot has one joint at least")
        for joint, model in models.items():
            if not isinstance(joint, str) or not joint:
                raise KindError(f"models: a joint's name must be a text, got {joint!r:.60}")
            of_type(f"models[{joint!r}]", model, HarmonicModel, "a trueangle.HarmonicModel")
        for joint in signals or {}:
            if joint not in models:
                raise ArgumentError(
                    f"signals: no joint {joint!r}; the joints are {', '.join(models)}"
                )
        self._models = dict(models)
        self.name = name
        self.signals: Mapping[str, Columns] = MappingProxyType(
            {joint: wanted_columns(columns) for joint, columns in (signals or {}).items()}
        )

    def __getitem__(self, joint: str) -> HarmonicModel:
        return self._models[joint]

    def __iter__(self) -> Iterator[str]:
        return iter(self._models)

    def __len__(self) -> int:
        return len(self._models)

    def __hash__(self) -> int:
        return hash(tuple(self._models.items()))

    def __reduce__(self) -> Any:
        signals = {joint: dict(columns) for joint, columns in self.signals.items()}
        return _rebuilt, (self._models, self.name, signals)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of their angles."""
        return tuple(self._models)

    def correct(
        self, positions: ArrayLike, **signals: Unpack[GivenSignals[ArrayLike]]
    ) -> NDArray[np.floating[Any]]:
        """True angles of all joints.

        Parameters
        ----------
        positions : array_like, shape (J,) or (N, J)
            Indicated angles in the order of `joints`, each in its model's unit; rows in the
            order they were taken.
        **signals : array_like
            ``velocity``, ``torque`` ... where terms of a model need them: of the shape of the
            positions or one that numpy spreads to it (a value per joint, ``(N, 1)`` for all).
            What a joint is coupled to is taken from the positions; ``coupled_JOINT`` gives the
            angle of a joint that is not among them.

        Returns
        -------
        ndarray of the shape of ``positions``
            float32 for float32, else float64; the columns of (N, J) lie one after the other.

        Raises
        ------
        ArgumentError
            Another shape; a signal that a model needs is missing.

        Notes
        -----
        Costs what a call of `HarmonicModel.correct` for every column costs.
        """
        check_signal_names(signals)
        given = np.asarray(positions)
        if given.ndim not in (1, 2) or given.shape[-1] != len(self):
            raise ArgumentError(
                f"positions must have the shape ({len(self)},) or (N, {len(self)}), the angles of "
                f"{', '.join(self)}; got {given.shape}"
            )
        if given.dtype.kind not in "fiu":
            raise KindError(f"positions must be real numbers, got an array of {given.dtype}")
        spread: dict[str, NDArray[Any]] = {}
        for name, values in signals.items():
            if values is None:
                continue
            try:
                spread[name] = np.broadcast_to(np.asarray(values), given.shape)
            except ValueError:
                raise ArgumentError(
                    f"{name} must have the shape of positions {given.shape}, or one that numpy "
                    f"spreads to it; got {np.asarray(values).shape}"
                ) from None
        kind = np.float32 if given.dtype == np.float32 else np.float64
        corrected = np.empty(given.shape[::-1], dtype=kind)
        rows = corrected.reshape(len(self), -1)
        columns = given.reshape(-1, len(self)).T
        for j, (joint, model) in enumerate(self.items()):
            own: Any = {n: v.reshape(-1, len(self))[:, j] for n, v in spread.items()}
            for signal in model.signals:
                other = coupled_joint(signal)
                if other is not None and other in self:
                    unit = model.period / self[other].period
                    own[signal] = columns[self.joints.index(other)] * unit
            try:
                model.correct(columns[j], out=rows[j], **own)
            except (ArgumentError, MissingSignalError) as error:
                raise type(error)(f"joint {joint}: {error}") from None
        return corrected.T

    def compensator(self) -> JointsStep[Robot]:
        """``step(positions) -> corrected`` for one sample of all joints at a time.

        One call of the compiled core for all joints: of an array of float64 it allocates
        nothing but the result, and nothing at all with ``step(positions, out=array)``. A result
        that nobody holds any more is the array of a later one. The
        numbers are those of every model's own `HarmonicModel.compensator`, to the last bit.
        With terms it is ``step(positions, velocity=, torque=, ...)``, a value per joint or one
        for all, and keeps the state of travel; no joint moves where one lacks a signal. What a
        joint is coupled to is taken from the positions.

        ``step.swap(robot)`` corrects by the models of another robot of the same joints from the
        next step on; what is known about the travel stays where all its models can hold it.

        Raises
        ------
        ArgumentError
            A joint is coupled to one that the robot does not have.

        Examples
        --------
        >>> from trueangle import Shaft
        >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
        >>> step = Robot({"a": model, "b": model}).compensator()
        >>> step(np.array([90.5, 0.0])).round(9)
        array([90.,  0.])
        """
        core = self._prepared()
        step: JointsStep[Robot] = exchangeable_step(core.step, partial(_swap, core, self))
        return step

    def _prepared(self) -> _core.RobotStep:
        """What corrects one sample of all joints at a time, in the core."""
        parts = [m._core_corrector() if m.terms else m._series for m in self.values()]
        return _core.RobotStep(list(self), parts)

    def save(self, path: str | PathLike[str]) -> None:
        """Write all models to one file (JSON), complete or not at all.

        Raises
        ------
        FileError
            An ending of another format, a file that the models were fitted to.
        """
        save_robot(self, self.name, self.signals, path)

    def _brief(self) -> str:
        return f"{self.name or 'unnamed'}, {counted(len(self), 'joint')}: {', '.join(self)}"

    def summary(self) -> str:
        """Every joint with its orders and the most that their correction, with its zero, can be."""
        lines = [f"robot {self.name}".rstrip() + f": {counted(len(self), 'joint')}"]
        for joint, model in self.items():
            most = arcsec(abs(model.constant) + float(model.amplitudes.sum()), model.period)
            orders = counted(len(model.orders), "order")
            terms = "".join(f", {term.kind}" for term in model.terms)
            lines.append(
                f"  {joint}: {orders}{terms}, at most {most:.4g} arcsec"
                f"{' plus terms' if model.terms else ''}, angles in {unit_name(model.period)}"
            )
        return laid_out(lines)


def _rebuilt(models: dict[str, HarmonicModel], name: str, signals: dict[str, Any]) -> Robot:
    return Robot(models, name=name, signals=signals)


def _swap(core: _core.RobotStep, first: Robot, robot: Robot) -> None:
    """Let ``core``, made for the ``first`` robot, correct by another one's models."""
    of_type("robot", robot, Robot, "a Robot")
    joints, others = (
        [(name, model.period, model.indicated_sign) for name, model in entry.items()]
        for entry in (first, robot)
    )
    if others != joints:
        raise ArgumentError(
            f"swap: robot has the joints {', '.join(robot)}; they must be {', '.join(first)}, with "
            "the same periods and signs"
        )
    core.swap(robot._prepared())
