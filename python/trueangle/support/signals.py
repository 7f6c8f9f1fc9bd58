"""Signals of a run in addition to its two angles: the list of their names, units and columns.

A further signal is a line of `SIGNALS`: columns of files, `CalibrationRun.signal` and the
option for signals follow it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Generic, NamedTuple, TypeAlias, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from .layout import counted
from .suggestions import did_you_mean

#: Values by the name of the signal; one per reading, or one for all.
Signals: TypeAlias = Mapping[str, ArrayLike]


T = TypeVar("T")


class GivenSignals(TypedDict, Generic[T], total=False):
    """Keyword arguments of corrections: the signals a joint's control loop can have.

    Attributes
    ----------
    direction
        Sign of travel; 0 keeps the last one.
    velocity
        Angle units per second.
    temperature
        Degrees Celsius.
    torque
        Newton metres at the output.
    current
        Amperes of the motor.
    """

    direction: T | None
    velocity: T | None
    temperature: T | None
    torque: T | None
    current: T | None


#: Names of the signals that a correction may take, in addition to angles of other joints.
AT_RUN_TIME: tuple[str, ...] = tuple(GivenSignals.__annotations__)

#: Before the name of another joint: the signal that is its angle.
COUPLED = "coupled_"


def coupled_joint(name: str) -> str | None:
    """The other joint whose indicated angle the signal ``name`` is; None of other signals.

    Examples
    --------
    >>> coupled_joint("coupled_wrist2"), coupled_joint("torque")
    ('wrist2', None)
    """
    return (name.startswith(COUPLED) and name.removeprefix(COUPLED)) or None


def is_run_time_signal(name: str) -> bool:
    """Whether a correction may take a signal of this name."""
    return name in AT_RUN_TIME or coupled_joint(name) is not None


def check_signal_names(given: Iterable[str]) -> None:
    """Refuse keyword arguments that no correction takes, as Python does.

    Raises
    ------
    TypeError
    """
    for name in given:
        if not is_run_time_signal(name):
            raise TypeError(
                f"got an unexpected keyword argument {name!r}; signals are "
                f"{', '.join(AT_RUN_TIME)} and {COUPLED}JOINT{did_you_mean(name, AT_RUN_TIME)}"
            )


class Signal(NamedTuple):
    """One signal.

    Attributes
    ----------
    name : str
    kind : {"time", "angle", "velocity", "plain"}
        What its unit is one of. Angles and velocities are kept in the unit of the run's
        period, times in seconds, others in the unit of their only column.
    column : str
        Name of its column; of angles and velocities, with ``{}`` for the unit.
    meaning : str
    """

    name: str
    kind: str
    column: str
    meaning: str


#: Every signal by its name.
SIGNALS: Mapping[str, Signal] = {
    signal.name: signal
    for signal in (
        Signal("time", "time", "time_s", "seconds, not decreasing within a run"),
        Signal("temperature", "plain", "temperature_C", "degrees Celsius"),
        Signal("torque", "plain", "torque_Nm", "newton metres at the output"),
        Signal("current", "plain", "current_A", "of the motor, amperes, with its sign"),
        Signal("velocity", "velocity", "velocity_{}_s", "of the output"),
        Signal("direction", "plain", "direction", "of travel: -1, 0 or 1"),
        Signal("mount", "angle", "mount_{}", "how far the reference was turned on its mount"),
        Signal("shift", "angle", "shift_{}", "how far one of two encoders was turned"),
        Signal("motor", "angle", "motor_{}", "the motor's own angle, not reduced"),
        Signal("sine", "plain", "sine", "channel of a sensor that follows the sine"),
        Signal("cosine", "plain", "cosine", "channel of a sensor that follows the cosine"),
        Signal("sine2", "plain", "sine2", "sine of the second track of a sensor"),
        Signal("cosine2", "plain", "cosine2", "cosine of the second track of a sensor"),
        Signal("excitation", "plain", "excitation", "of a resolver, sampled with sine and cosine"),
    )
}

#: Signals that are fields of `CalibrationRun`; the others are in its ``signals``.
FIELDS = ("time", "temperature", "torque", "mount", "velocity")

_HEAD = re.compile(r"head[1-9][0-9]?")


def find_signal(name: str) -> Signal:
    """The signal called ``name``; ``head1`` to ``head99`` are readings of several heads.

    ``coupled_JOINT`` is the indicated angle of another joint of a robot, as it counts turns.

    Raises
    ------
    ArgumentError
        No signal has this name.

    Examples
    --------
    >>> find_signal("head2").column
    'head2_{}'
    """
    if _HEAD.fullmatch(name):
        return Signal(name, "angle", f"{name}_{{}}", "one of several heads on one disc")
    if coupled_joint(name) is not None:
        return Signal(name, "angle", f"{name}_{{}}", "indicated angle of another joint")
    try:
        return SIGNALS[name]
    except KeyError:
        known = [*SIGNALS, "head1", "head2", f"{COUPLED}JOINT"]
        raise ArgumentError(
            f"no signal is called {name!r}; signals are "
            f"{', '.join(known)}{did_you_mean(name, known)}"
        ) from None


def signal_columns(
    signals: Signals, size: int, reserved: tuple[str, ...] = FIELDS
) -> dict[str, NDArray[np.float64]]:
    """``signals`` as one read-only array of ``size`` finite numbers each.

    Raises
    ------
    ArgumentError
        A name that no signal has, or one of ``reserved``, which are given on their own.
    """
    if not isinstance(signals, Mapping):
        raise ArgumentError(
            f"signals must be a mapping of names to values, got {type(signals).__name__}"
        )
    found = {}
    for name, values in signals.items():
        signal = find_signal(name)
        if signal.name in reserved:
            raise ArgumentError(
                f"{name} is a separate argument: give `{name}=` as well as `signals=`"
            )
        found[name] = signal_column(f"signals[{name!r}]", values, size)
    return found


def signal_column(name: str, values: ArrayLike, size: int | None) -> NDArray[np.float64]:
    """``values`` as a read-only one-dimensional float array of ``size`` finite numbers.

    One number is repeated ``size`` times; without ``size`` any length but zero is accepted.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as cause:
        raise ArgumentError(f"{name} must be numbers: {cause}") from None
    if size is not None and array.ndim == 0:
        array = np.full(size, float(array))
    if array.ndim != 1:
        raise ArgumentError(f"{name} must be one-dimensional, got shape {array.shape}")
    if size is None and array.size == 0:
        raise ArgumentError(f"{name} is empty: a run needs at least one reading")
    if size is not None and array.size != size:
        raise ArgumentError(
            f"{name} has {counted(int(array.size), 'reading')}, reference has {size}"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        i = int(bad[0])
        raise ArgumentError(
            f"{name}[{i}] is {array[i]}: readings must be finite; drop the row "
            f"({bad.size} such value{'s' if bad.size > 1 else ''})"
        )
    array.flags.writeable = False
    return array
