"""Joints of a log: their models, the columns they are read from, and their correction."""

from __future__ import annotations

import hashlib
import json
import tempfile
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError, OutsideSpanWarning
from ..model.file import load_model
from ..model.model import HarmonicModel
from ..model.robot import Robot, is_robot_file, load_robot
from ..support.files import sha256_of
from ..support.roles import RoleColumn, role_code, wanted_columns
from .columns import (
    SIGNAL_COLUMNS,
    AngleColumn,
    find_angle_column,
    find_channel_columns,
    find_joint_signal,
)
from .statistics import ChannelStatistics, CorrectionStatistics, UnitEvidence
from .turns import TurnCounter, TurnState

Array: TypeAlias = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class LogJoint:
    """A joint and how to find it in a log.

    Parameters
    ----------
    model : HarmonicModel
    name : str, optional
        Needed where a log holds several joints.
    column : str, optional
        Of the indicated angle; searched by name where None.
    signals : mapping of str to (str, str or None)
        Columns of the signals that terms of the model need, and their units, where their
        names do not state them.
    unit : str, optional
        Of the indicated angle.
    file, sha256 : str
        Of the model file, for the provenance of the output.
    """

    model: HarmonicModel
    name: str | None = None
    column: str | None = None
    signals: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)
    file: str = ""
    sha256: str = ""
    unit: str | None = None

    @classmethod
    def load(
        cls,
        path: str | PathLike[str],
        name: str | None = None,
        column: str | None = None,
        signals: Mapping[str, tuple[str, str | None]] | None = None,
        unit: str | None = None,
    ) -> LogJoint:
        """Joint of the model file ``path``."""
        model = load_model(path)  # lets in models of a bounded size only
        digest = sha256_of(path)
        return cls(model, name, column, signals or {}, Path(path).name, digest, unit)

    @cached_property
    def digest(self) -> str:
        """sha256 of the model file: of the one it would be saved as, where it has none."""
        if self.sha256:
            return self.sha256
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "model.json")
            self.model.save(file)
            return hashlib.sha256(file.read_bytes()).hexdigest()


@dataclass(frozen=True)
class LogSettings:
    """Settings that `trueangle correct` applies to every log.

    ``topic`` and ``output_topic`` belong to ROS bags; ``threads`` bounds the threads of
    the correction.
    """

    joints: tuple[LogJoint, ...]
    unit: str | None = None
    counts_per_turn: float | None = None
    topic: str | None = None
    output_topic: str | None = None
    threads: int | None = None

    def channels(
        self,
        path: object,
        header: Sequence[str],
        before: Mapping[str, JointState] | None = None,
        unit: str | None = None,
    ) -> list[JointChannel]:
        """One channel per joint for a log with the columns ``header``.

        ``before`` gives by joint how the log before ended; ``unit`` is that of the log's
        format where it defines one.

        Raises
        ------
        FileError
            A joint has no angle among the columns, or two have the same.
        """
        found: list[JointChannel] = []
        taken = list(header)
        for joint in self.joints:
            if joint.model.channels is not None:
                angle, signals = find_channel_columns(
                    path, taken, joint.model, joint.name, joint.signals
                )
                signals |= _signal_columns(path, header, joint)
                taken.append(angle.corrected)
                state = (before or {}).get(joint.name or "", JointState())
                found.append(JointChannel(joint, angle, signals, state, self))
                continue
            angle = find_angle_column(
                path,
                joint.model.period,
                taken,
                joint=joint.name,
                column=joint.column,
                unit=joint.unit or self.unit or unit,
                counts_per_turn=self.counts_per_turn,
                sign=joint.model.indicated_sign,
            )
            taken.append(angle.corrected)
            state = (before or {}).get(joint.name or "", JointState())
            found.append(
                JointChannel(joint, angle, _signal_columns(path, header, joint), state, self)
            )
        return found

    @property
    def digest(self) -> str:
        """Changes with everything that changes the output."""
        content = [
            [[j.name, j.column, sorted(j.signals.items()), j.digest, j.unit] for j in self.joints],
            [self.unit, self.counts_per_turn, self.topic, self.output_topic],
        ]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    @property
    def counts_turns(self) -> bool:
        """True when a model's error does not repeat after one turn."""
        return not all(joint.model.is_periodic for joint in self.joints)

    @property
    def follows_travel(self) -> bool:
        """True when a term of a model depends on the way to the reading."""
        return any(joint.model.follows_travel for joint in self.joints)

    @property
    def needs_order(self) -> bool:
        """True when a row depends on rows before: its turn, or its direction of travel."""
        return self.counts_turns or self.follows_travel


def _signal_columns(path: object, header: Sequence[str], joint: LogJoint) -> dict[str, RoleColumn]:
    """Columns of the signals that the joint's model uses; time can replace velocity.

    Raises
    ------
    FileError
        Names the column of a signal that the model cannot do without.
    """
    model = joint.model
    found: dict[str, RoleColumn] = {}
    for signal in (*model.uses_signals, *(["time"] if "velocity" in model.uses_signals else [])):
        if signal == "time" and "velocity" in found:
            continue
        column = find_joint_signal(path, header, signal, joint.name, joint.signals.get(signal))
        if column is not None:
            found[signal] = column
    for term in model.terms:
        for signal in term.needs:
            stand_in = {"velocity": {"time"}, "direction": {"velocity", "time"}}.get(signal, set())
            if signal not in found and not stand_in & found.keys():
                columns = " or ".join(
                    SIGNAL_COLUMNS[name][0] for name in (signal, *sorted(stand_in))
                )
                raise FileError(
                    path,
                    f"no column {columns}: the model's term '{term.kind}' needs {signal}; "
                    f"name its column with {role_code(signal, unit=None)}",
                    line=1,
                )
    return found


class JointState(NamedTuple):
    """Where a joint stopped, for the log that goes on from there.

    ``travel`` is the state of the corrector of a model with terms.
    """

    turns: TurnState = TurnState()
    travel: Sequence[float] = ()

    @classmethod
    def of(cls, plain: Sequence[Any]) -> JointState:
        """From lists of JSON."""
        turns, travel = plain
        return cls(TurnState(*turns), tuple(travel))


class JointChannel:
    """The indicated angle of one joint in one log, corrected batch after batch.

    Batches must come in the order of the rows: turns are counted over their borders where
    the model needs them (a model whose error repeats after one turn does not, and does not
    pay for it).
    """

    def __init__(
        self,
        joint: LogJoint,
        angle: AngleColumn,
        signals: Mapping[str, RoleColumn],
        before: JointState,
        settings: LogSettings,
    ) -> None:
        self.joint = joint
        self.angle = angle
        self.signals = {signal: column.name for signal, column in signals.items()}
        self.statistics = CorrectionStatistics()
        self._threads = settings.threads
        model = joint.model
        self._scale = model.period / angle.period
        self._channels = None if model.channels is None else ChannelStatistics(model.channels)
        self._corrector = model.corrector() if model.terms else None
        self._signal_columns = {s: _with_unit(c, angle.unit) for s, c in signals.items()}
        self._counts = settings.counts_per_turn
        if self._corrector is not None and before.travel:
            self._corrector.state = before.travel
        self._evidence = UnitEvidence(angle.period) if angle.assumed else None
        self._counter = None if model.is_periodic else TurnCounter(angle.period, before.turns)
        span = model.partial_span
        self._span = None if span is None else (span[0] / self._scale, span[1] / self._scale)

    @property
    def column(self) -> str:
        """The column that is corrected."""
        return self.angle.name

    @property
    def added(self) -> str:
        """The column that is added."""
        return self.angle.corrected

    @property
    def entry(self) -> dict[str, Any]:
        """How the added column is made, for the note that outputs carry."""
        return {
            "column": self.angle.corrected,
            "from": self.angle.name,
            "model": self.joint.file,
            "model_sha256": self.joint.digest,
        }

    @property
    def name(self) -> str:
        """Name of the joint; empty where a log has one only."""
        return self.joint.name or ""

    @property
    def counts_turns(self) -> bool:
        """True where the model's error does not repeat after one turn."""
        return self._counter is not None

    @property
    def state(self) -> JointState:
        """Where the readings so far leave the joint."""
        turns = TurnState() if self._counter is None else self._counter.state
        return JointState(turns, () if self._corrector is None else self._corrector.state)

    def correct(
        self, indicated: NDArray[Any], signals: Mapping[str, NDArray[Any]] | None = None
    ) -> Array:
        """Corrected angles of the next batch, in the unit of the column.

        float32 gives float32, integers and float64 give float64; NaN stays NaN; the turn of
        a reading is kept.
        """
        if self._channels is not None:
            signals = dict(signals or {})
            known = self._channels.channels
            others = [signals.pop(role) for role in known.roles[1:]]
            if known.excitation_deg is not None:
                indicated, *others = known.demodulated(indicated, *others)
            self._channels.update(indicated, *others)
            indicated = known.angle(indicated, *others)
        kept = indicated.dtype if indicated.dtype == np.float32 else np.dtype(np.float64)
        if self._counter is None:
            corrected = self._apply(indicated, signals)
        else:
            offset = self._counter.count(indicated) * self.angle.period
            corrected = (self._apply(indicated + offset, signals) - offset).astype(kept)
        self.statistics.update(indicated, corrected, self.angle.period, self._span)
        if self._evidence is not None:
            self._evidence.update(indicated)
        return corrected

    def _apply(self, angle: NDArray[Any], signals: Mapping[str, NDArray[Any]] | None) -> Array:
        model, scale = self.joint.model, self._scale
        values = angle if scale == 1.0 else angle * scale
        with warnings.catch_warnings():
            # Rows outside the span are counted in the summary instead.
            if self._span is not None:
                warnings.simplefilter("ignore", OutsideSpanWarning)
            given: Any = {
                signal: self._signal_columns[signal].values(values, model.period, self._counts)
                for signal, values in (signals or {}).items()
            }
            apply: Any = model.correct if self._corrector is None else self._corrector
            corrected: Array = apply(values, threads=self._threads, **given)
        return corrected if scale == 1.0 else corrected / scale

    def summary(self) -> dict[str, Any]:
        """Counts and sizes for people and for JSON."""
        numbers = self.statistics
        return {
            "joint": self.joint.name,
            "column": self.angle.name,
            "corrected": self.angle.corrected,
            "rms_correction_arcsec": numbers.rms_arcsec,
            "max_abs_correction_arcsec": numbers.max_abs_arcsec,
            "missing": numbers.missing,
            "outside_span": numbers.outside if self._span is not None else None,
            "unit_note": (self._channels and self._channels.sentence)
            or (self._evidence and self._evidence.sentence(self.angle.name, self._span)),
        }


def _with_unit(column: RoleColumn, angle_unit: str) -> RoleColumn:
    """A velocity whose column does not state a unit has that of the angle, per second."""
    if column.role == "velocity" and column.unit is None:
        return column._replace(unit=f"{angle_unit}/s")
    return column


def logged_joints(
    model: HarmonicModel | str | PathLike[str] | Mapping[str, Any],
    column: str | Mapping[str, str] | None = None,
    signals: Mapping[str, Any] | None = None,
) -> tuple[LogJoint, ...]:
    """Joints from one model (or its file), a robot (or its file), or a mapping of names to models.

    ``column`` and ``signals`` are those of the joint, or mappings by joint name.
    """
    digest = file = ""
    if isinstance(model, str | PathLike) and is_robot_file(model):
        file, digest = Path(model).name, sha256_of(model)
        model = load_robot(model)
    if isinstance(model, Robot):
        known = {**model.signals, **(signals or {})}
        for joint in column if isinstance(column, Mapping) else ():  # replaces that of the fit
            known[joint] = {k: v for k, v in known.get(joint, {}).items() if k != "indicated"}
        signals = known
    by_name: Mapping[Any, Any] = model if isinstance(model, Mapping) else {None: model}
    if not by_name:
        raise ArgumentError("model is empty: at least one joint is needed")
    columns: Mapping[Any, str | None] = (
        column if isinstance(column, Mapping) else dict.fromkeys(by_name, column)
    )
    _check_known(columns, by_name, "column")
    by_joint: Mapping[Any, Any] = signals or {}
    if signals and not isinstance(model, Mapping):
        by_joint = {None: signals}
    _check_known(by_joint, by_name, "signals")
    found = (
        _joint(entry, name, columns.get(name), wanted_columns(by_joint.get(name)))
        for name, entry in by_name.items()
    )
    return tuple(replace(j, file=file, sha256=digest) if digest else j for j in found)


def _check_known(names: Iterable[Any], known: Mapping[Any, Any], argument: str) -> None:
    for name in names:
        if name not in known:
            listed = ", ".join(str(k) for k in known if k is not None)
            hint = f"the joints are {listed}" if listed else "name the joint's model too"
            raise ArgumentError(f"{argument}: no joint {name!r} has a model; {hint}")


def _joint(
    entry: Any, name: str | None, column: str | None, signals: dict[str, tuple[str, str | None]]
) -> LogJoint:
    unit = None
    if "indicated" in signals:
        if column is not None:
            raise ArgumentError(
                "`column=` and `signals={'indicated': 'NAME'}` both name the angle; give one"
            )
        column, unit = signals.pop("indicated")
    if isinstance(entry, HarmonicModel):
        return LogJoint(entry, name, column, signals, unit=unit)
    if isinstance(entry, (str, PathLike)):
        return LogJoint.load(entry, name, column, signals, unit)
    raise ArgumentError(f"model must be a HarmonicModel or its file, got {type(entry).__name__}")
