"""One calibration run: paired readings of a reference and of the joint's own encoder."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError, KindError
from ..support.angles import check_period, checked_sign, circular_mean, unwrapped, wrap
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.files import InputFile
from ..support.layout import counted
from ..support.signals import FIELDS, find_signal, signal_column, signal_columns
from .rawchannels import Channels


@told_kinds
@dataclass(frozen=True, eq=False)
class CalibrationRun:
    """Readings of one run, in the order they were taken.

    Parameters
    ----------
    reference : array_like, shape (n,)
        True output angle; may cross 0/period any number of times in either direction.
    indicated : array_like, shape (n,)
        The joint's reading reduced to the output, in the same unit, with any zero.
    period : float
        One turn in the unit of both: ``2*pi`` (default), 360, 1, or counts per turn.
    time : array_like, shape (n,), optional
        Seconds, not decreasing.
    temperature : array_like or float, optional
        Degrees Celsius.
    torque : array_like or float, optional
        Newton metres at the output.
    mount : array_like or float, optional
        How far the reference artefact was turned on its mount, unit of ``reference``.
    label : str, optional
    velocity : array_like, optional
        Output velocity in angle units per second; derived from ``reference`` and
        ``time`` where absent (`CalibrationRun.speed`).
    weights : array_like, shape (n,), optional
        Relative weights of the readings (inverse variances), not negative.
    signals : mapping of str to array_like or float, optional
        Further signals of `trueangle.support.signals.SIGNALS` by name: ``current`` (A), ``shift``
        and the angles ``motor``, ``head1``, ``head2`` ... in the unit of ``reference``.
    unit : str, optional
        Label of the joint that the run is of, where runs of several are read together.
    when : str, optional
        Date and time of the calibration, ISO 8601.
    left_out : int
        Rows of the file that an empty cell kept out of the run.
    columns : mapping of str to array_like, optional
        Further columns of the file, kept and ignored.
    source : Source, optional
        The file the readings came from, for the provenance of models.
    indicated_sign : {1, -1}
        -1 of a sensor that counts the other way: ``indicated`` is minus what it reads. Models of
        the run keep it, for `trueangle.correct` and `trueangle.export_model`.
    channels : Channels, optional
        By which ``indicated`` was made of the signals ``sine`` and ``cosine``.
    roles : mapping of str to (str, str or None), optional
        Column and unit in the file by role, for messages; a reversed sensor's with a minus.

    Raises
    ------
    ArgumentError
        Arrays that differ in length, are empty or not one-dimensional, values that
        are not finite, or decreasing ``time``.

    Examples
    --------
    >>> run = CalibrationRun([0.0, 90.0, 180.0], [359.9, 90.1, 180.0], period=360.0)
    >>> run.error.round(6)
    array([-0.1,  0.1,  0. ])
    """

    reference: Array
    indicated: Array
    period: float = 2.0 * math.pi
    time: Array | None = None
    temperature: Array | None = None
    torque: Array | None = None
    mount: Array | None = None
    label: str | None = None
    velocity: Array | None = field(default=None, kw_only=True)
    weights: Array | None = field(default=None, kw_only=True)
    signals: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    unit: str | None = field(default=None, kw_only=True)
    when: str | None = field(default=None, kw_only=True)
    left_out: int = field(default=0, kw_only=True)
    columns: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    source: InputFile | None = field(default=None, kw_only=True)
    indicated_sign: int = field(default=1, kw_only=True)
    channels: Channels | None = field(default=None, kw_only=True)
    roles: Mapping[str, tuple[str, str | None]] = field(default_factory=dict, kw_only=True)

    if TYPE_CHECKING:  # what is taken is more than what is kept

        def __init__(
            self,
            reference: ArrayLike,
            indicated: ArrayLike,
            period: float = 2.0 * math.pi,
            time: ArrayLike | None = None,
            temperature: ArrayLike | None = None,
            torque: ArrayLike | None = None,
            mount: ArrayLike | None = None,
            label: str | None = None,
            *,
            velocity: ArrayLike | None = None,
            weights: ArrayLike | None = None,
            signals: Mapping[str, Any] = ...,
            unit: str | None = None,
            when: str | None = None,
            left_out: int = 0,
            columns: Mapping[str, Any] = ...,
            source: InputFile | None = None,
            indicated_sign: int = 1,
            channels: Channels | None = None,
            roles: Mapping[str, tuple[str, str | None]] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "period", check_period(self.period))
        put(self, "indicated_sign", checked_sign(self.indicated_sign))
        reference = signal_column("reference", self.reference, None)
        indicated = signal_column("indicated", self.indicated, reference.size)
        put(self, "reference", _resolved(reference, indicated, self.period))
        put(self, "indicated", _resolved(indicated, self.reference, self.period))
        for name in (*FIELDS, "weights"):
            values = getattr(self, name)
            if values is not None:
                put(self, name, signal_column(name, values, reference.size))
        put(self, "signals", MappingProxyType(signal_columns(self.signals, reference.size)))
        if self.time is not None:
            back = np.flatnonzero(np.diff(self.time) < 0.0)
            if back.size:
                i = int(back[0]) + 1
                raise ArgumentError(
                    f"time must not decrease within a run{self._named()}: "
                    f"time[{i}] = {self.time[i]:g} after {self.time[i - 1]:g}; "
                    "sort the rows or split the run there"
                )
        if self.weights is not None and (self.weights < 0.0).any():
            i = int(np.flatnonzero(self.weights < 0.0)[0])
            raise ArgumentError(f"weights[{i}] must not be negative, got {self.weights[i]:g}")
        put(self, "columns", MappingProxyType(dict(self.columns)))

    def __len__(self) -> int:
        return int(self.reference.size)

    def __repr__(self) -> str:
        held = counted(len(self), "reading")
        return f"CalibrationRun({self.label!r}, {held}, period={self.period:g})"

    def __reduce__(self) -> tuple[Any, ...]:
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        plain = {"columns": dict(self.columns), "signals": dict(self.signals)}
        return _rebuild, (values | plain,)

    def _named(self) -> str:
        return f" ({self.label})" if self.label else ""

    def part(self, rows: Any, **changes: Any) -> CalibrationRun:
        """Some of its readings, by any index of numpy, as a run of their own."""
        names = ("reference", "indicated", "weights", *FIELDS)
        each = {name: values for name in names if (values := getattr(self, name)) is not None}
        others = {name: np.asarray(values)[rows] for name, values in self.columns.items()}
        signals = {name: values[rows] for name, values in self.signals.items()}
        taken = {name: values[rows] for name, values in each.items()}
        return replace(self, **{**taken, "signals": signals, "columns": others, **changes})

    def signal(self, name: str) -> Array | None:
        """Values of the signal ``name``, a field or one of ``signals``; None without.

        Examples
        --------
        >>> run = CalibrationRun([0.0, 1.0], [0.0, 1.0], torque=2.0, signals={"current": 0.5})
        >>> run.signal("torque"), run.signal("current"), run.signal("shift")
        (array([2., 2.]), array([0.5, 0.5]), None)
        """
        if name in FIELDS:
            values: Array | None = getattr(self, name)
            return values
        return self.signals.get(find_signal(name).name)

    @property
    def heads(self) -> dict[str, Array]:
        """The signals ``head1``, ``head2`` ... in the order of their numbers."""
        names = [name for name in self.signals if name.startswith("head")]
        return {name: self.signals[name] for name in sorted(names, key=lambda n: int(n[4:]))}

    @property
    def zero(self) -> float:
        """Circular mean of ``indicated - reference``: the run's zero offset, about."""
        return circular_mean(self.indicated - self.reference, self.period)

    @property
    def error(self) -> Array:
        """``indicated - reference`` wrapped into ``(-period/2, period/2]``."""
        return wrap(self.indicated - self.reference, self.period)

    @property
    def centred_error(self) -> Array:
        """`error` unfolded around `zero`, so that no reading jumps by a turn.

        The run's own zero is still in it; values may lie outside half a turn.
        """
        zero = self.zero
        return zero + wrap(self.indicated - self.reference - zero, self.period)

    @property
    def unwrapped_reference(self) -> Array:
        """``reference`` without jumps at 0/period (`trueangle.support.angles.unwrapped`)."""
        return unwrapped(self.reference, self.period)

    @property
    def speed(self) -> Array | None:
        """Signed output velocity per reading, or None without ``time`` and ``velocity``.

        ``velocity`` where given, else central differences of the unwrapped reference.
        """
        if self.velocity is not None:
            return self.velocity
        if self.time is None or len(self) < 2:
            return None
        # Equal time stamps: average the angle over them first, then differentiate.
        time, inverse = np.unique(self.time, return_inverse=True)
        if time.size < 2:
            return None
        count = np.bincount(inverse)
        angle = np.bincount(inverse, weights=self.unwrapped_reference) / count
        return np.asarray(np.gradient(angle, time)[inverse])

    @property
    def direction(self) -> Array:
        """Direction of travel per reading: -1 or +1, 0 of a run that does not move.

        The signal ``direction`` where given, else the sign of ``velocity``, else of the
        last step of the reference that was not zero; a reading belongs to the step that
        led to it, those before the first motion to that. A velocity below 1e-12 of the
        greatest is the rounding of a rest, which has the direction of the motion before it.
        """
        given = self.signals.get("direction", self.velocity)
        if given is not None:
            # What a moving mean leaves of zeros depends on the processor.
            sign = np.sign(given) * (np.abs(given) > 1e-12 * np.abs(given).max(initial=0.0))
        elif len(self) < 2:
            return np.zeros(len(self))
        else:
            steps = np.sign(np.diff(self.unwrapped_reference))
            sign = np.concatenate([steps[:1], steps])
        moving = np.flatnonzero(sign)
        if moving.size == 0:
            return np.zeros(len(self))
        last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(sign.size), moving[0]))
        return np.asarray(sign[last])


def as_runs(runs: CalibrationRun | Iterable[CalibrationRun]) -> list[CalibrationRun]:
    """One run or several as a list of runs that share a period.

    Raises
    ------
    ArgumentError
        No run at all, something else than runs, or runs in different units.
    """
    if isinstance(runs, CalibrationRun):
        return [runs]
    if not isinstance(runs, Iterable):
        raise KindError(f"runs must be a CalibrationRun or a list of them, got {runs!r:.60}")
    found = list(runs)
    if not found:
        raise ArgumentError("runs is empty: at least one CalibrationRun is needed")
    for i, run in enumerate(found):
        if not isinstance(run, CalibrationRun):
            raise ArgumentError(
                f"runs[{i}] must be a CalibrationRun, got {type(run).__name__}; "
                "read files with trueangle.read_runs"
            )
    periods = sorted({run.period for run in found})
    if len(periods) > 1:
        raise ArgumentError(
            f"the runs are in different units (periods {', '.join(f'{p:g}' for p in periods)}): "
            "convert them to one"
        )
    return found


def runs_or_data(data: Any) -> tuple[list[CalibrationRun] | None, Any]:
    """The list where ``data`` is a run or runs, else None; and the data, iterators as lists."""
    if isinstance(data, CalibrationRun):
        return [data], data
    if isinstance(data, Iterator) and not hasattr(data, "__arrow_c_stream__"):
        data = list(data)
    if not isinstance(data, list | tuple) or not any(isinstance(r, CalibrationRun) for r in data):
        return None, data
    for i, run in enumerate(data):
        if not isinstance(run, CalibrationRun):
            raise KindError(
                f"runs[{i}] must be a CalibrationRun as the others, got {type(run).__name__}; "
                "read files with trueangle.read_runs"
            )
    return list(data), data


def _resolved(angle: Array, other: Array, period: float) -> Array:
    """Angles, with those that a double does not resolve within a turn moved half a turn off.

    Such a number (1e300) is no angle: its wrapped value is rounding, which could look like a
    good reading. Half a period off the ``other`` angle it is an outlier to every test.
    """
    most = 2.0**40 * period  # at which a double resolves 1/4096 of a turn
    wild = np.abs(angle) > most
    if not wild.any():
        return angle
    resolved = np.where(wild, np.where(np.abs(other) > most, 0.0, other) + 0.5 * period, angle)
    resolved.flags.writeable = False
    return resolved


def _rebuild(values: dict[str, Any]) -> CalibrationRun:
    return CalibrationRun(**values)
