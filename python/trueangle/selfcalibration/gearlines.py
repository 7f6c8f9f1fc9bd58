"""The two readings of a geared joint, their motion, and the lines that both shafts leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError
from ..estimation.linear import least_squares
from ..support.arrays import Array
from .recording import Recording

#: Orders of each shaft that are tried by default.
_HIGHEST: Final = 8

#: Turns by which two orders must part over the travel to be two numbers.
SLIP: Final = 0.05

#: Steps whose mean gives the direction.
_WIDTH: Final = 5


class SharedLine(NamedTuple):
    """One order of the output, with every shaft that has it."""

    order: float
    output: int  # order of the output, 0 for none
    motor: int  # order of the motor, 0 for none

    @property
    def of(self) -> str:
        """What its number is a number of."""
        if self.output and self.motor:
            return (
                f"output {self.output} + motor {self.motor} "
                "(output encoder, motor encoder or gear: one number)"
            )
        if self.output:
            return f"output {self.output} (output encoder or gear)"
        return f"motor {self.motor} (motor encoder or gear)"


class GearedChannels(NamedTuple):
    """Both readings of every run, unwrapped, in radians; its time where recorded."""

    motor: list[Array]
    output: list[Array]
    time: list[Array | None]


def geared_channels(recordings: Sequence[Recording]) -> GearedChannels:
    """The readings of the runs.

    Raises
    ------
    NoModelError
        A run without one of the two.
    """
    motor, output, time = [], [], []
    for r in recordings:
        reading = r.indicated if r.indicated is not None else r.reference
        if r.motor is None or reading is None:
            raise NoModelError(
                f"{r.named}: both readings are needed, motor_deg (not reduced) and indicated_deg "
                "(the output encoder)"
            )
        motor.append(_unwrapped(r.motor))
        output.append(_unwrapped(reading))
        time.append(r.time)
    return GearedChannels(motor, output, time)


def _unwrapped(angle: Array) -> Array:
    if float(np.ptp(angle)) > 1.02 * 2.0 * math.pi:
        return angle
    return np.asarray(np.unwrap(angle, period=2.0 * math.pi))


def slope_ratio(channels: GearedChannels) -> float:
    """Motor turns per output turn, by the slope of one reading over the other."""
    top = bottom = 0.0
    for m, o in zip(channels.motor, channels.output, strict=True):
        dm, do = m - m.mean(), o - o.mean()
        top += float(dm @ dm)
        bottom += float(dm @ do)
    if bottom == 0.0:
        raise NoModelError(
            "the output does not move with the motor: give `gear_ratio=`, or record motion"
        )
    return top / bottom


def lines_of_gear(orders: str | Sequence[float], ratio: float, turns: float) -> list[SharedLine]:
    """Orders of both shafts; those that the travel cannot separate are listed once."""
    size = abs(ratio)
    numbers = range(1, _HIGHEST + 1) if isinstance(orders, str) else [int(k) for k in orders]
    lines = {float(k): SharedLine(float(k), k, 0) for k in numbers}
    for j in range(1, _HIGHEST + 1):
        order = j * size
        near = round(order)
        if near >= 1 and abs(order - near) * turns < SLIP:
            lines[float(near)] = SharedLine(float(near), near, j)
        else:
            lines[order] = SharedLine(order, 0, j)
    return [lines[k] for k in sorted(lines)]


def motion_varies(channels: GearedChannels, ratio: float) -> tuple[bool, bool]:
    """Whether both directions were travelled, and at speeds that differ.

    At one speed the column would hold nothing but the motor's own error, differentiated.
    """
    motions = [
        gear_motion(m / ratio, t) for m, t in zip(channels.motor, channels.time, strict=True)
    ]
    ways = np.unique(np.concatenate([np.unique(way) for way, _ in motions]))
    speed = np.abs(np.concatenate([v for _, v in motions]))
    known = all(t is not None for t in channels.time)
    # Speed is a separate regressor where it varies by this share of the highest.
    varied = known and float(speed.std()) > 0.2 * float(np.quantile(speed, 0.99))
    return bool({-1.0, 1.0} <= set(ways.tolist())), bool(varied)


def gear_motion(theta: Array, time: Array | None) -> tuple[Array, Array]:
    """Direction of travel (-1, 1) and speed of the output in radians per second."""
    step = np.diff(theta, prepend=theta[0])
    smooth = np.convolve(step, np.ones(_WIDTH) / _WIDTH, "same")
    sign = np.sign(smooth)
    moving = np.flatnonzero(sign)
    if moving.size == 0:
        return np.zeros(theta.size), np.zeros(theta.size)
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(sign.size), moving[0]))
    way = sign[last]
    if time is None:
        return np.asarray(way), np.zeros(theta.size)
    # Readings to either side from which the speed is estimated.
    spread = max(2, min(10, theta.size // 10))
    if theta.size < 2 * spread + 1:
        return np.asarray(way), np.zeros(theta.size)
    # A cubic has the slope of a swing where a difference over as many readings is too small.
    powers = np.vander(np.arange(-spread, spread + 1.0), 4, increasing=True)
    slope = least_squares(powers, np.eye(len(powers)))[1]
    turned, passed = (np.correlate(values, slope, "valid") for values in (theta, time))
    inner = turned / np.where(passed > 0.0, passed, np.inf)
    speed = np.pad(inner, spread, mode="edge")
    return np.asarray(way), speed


def near_reversal(way: Array) -> NDArray[np.bool_]:
    """Readings so near to a reversal that the direction of a smoothed step is none of theirs.

    Examples
    --------
    >>> near_reversal(np.repeat([1.0, -1.0], 6)).astype(int)
    array([0, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0])
    """
    near = np.zeros(way.size, dtype=bool)
    for k in np.flatnonzero(np.diff(way)):
        near[max(0, k - _WIDTH // 2) : k + 2 + _WIDTH // 2] = True
    return near
