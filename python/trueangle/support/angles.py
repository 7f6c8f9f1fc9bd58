"""Angles: periods and other units, arcsec, wrapping, circular means, sums over their powers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from .argumentkinds import told_kinds
from .display_units import ARCSEC_PER_DEG as ARCSEC_PER_DEG
from .display_units import ARCSEC_PER_TURN as ARCSEC_PER_TURN
from .display_units import UNIT_PERIODS as UNIT_PERIODS

#: Powers between two fresh evaluations: keeps rounding near 1e-15 * 64.
_RESEED: Final = 64

#: Points whose powers are kept at once: they stay in the cache.
_BLOCK: Final = 512


def check_period(period: float) -> float:
    """``period`` as a float, or an `ArgumentError` that states what it must be."""
    try:
        value = float(period)
    except (TypeError, ValueError):
        value = math.nan
    if not 1e-30 <= value <= 1e30:  # nor NaN
        raise ArgumentError(
            "period must be a positive finite number "
            f"(2*pi, 360, 1 or the counts per turn; 1e-30 to 1e30), got {period!r}"
        )
    return value


def checked_sign(sign: int) -> int:
    """``indicated_sign`` as it is, or an `ArgumentError` that states what it must be."""
    if isinstance(sign, bool) or sign not in (1, -1):
        raise ArgumentError(
            "indicated_sign must be 1, or -1 where the indicated angle is minus what the sensor "
            f"reads, got {sign!r}"
        )
    return int(sign)


def common_sign(signs: Iterable[int]) -> int:
    """The ``indicated_sign`` that all runs have, or an `ArgumentError` where they differ."""
    found = set(signs)
    if len(found) > 1:
        raise ArgumentError(
            "the indicated angles of some runs are minus what the sensor reads (-NAME, or "
            "indicated_sign=-1) and those of others are not: fit them one by one"
        )
    return found.pop() if found else 1


def zero_text(value: float, period: float) -> str:
    """A zero in the unit of ``period``, to a hundredth of an arcsecond at least.

    Examples
    --------
    >>> zero_text(3.59802e-05, 360.0)
    '0.000036 deg'
    """
    decimals = max(0, math.ceil(-math.log10(0.01 / arcsec(1.0, period))))
    # Adding zero takes the sign off what is rounded to nothing.
    return f"{round(value, decimals) + 0.0:.{decimals}f} {unit_name(period)}"


def unit_name(period: float) -> str:
    """Name of the unit in which one turn is ``period``: deg, rad, turn or count."""
    for name, value in UNIT_PERIODS.items():
        if period == value:
            return name
    return "count"


def arcsec(angle: float, period: float) -> float:
    """``angle`` (one turn = ``period``) in seconds of arc."""
    return angle * (ARCSEC_PER_TURN / period)


def from_arcsec(value: float, period: float) -> float:
    """Seconds of arc in the unit in which a turn is ``period``."""
    return float(value) * (period / ARCSEC_PER_TURN)


@told_kinds
def wrap(angle: ArrayLike, period: float = 2.0 * math.pi) -> NDArray[np.float64]:
    """Angle moved by whole turns into ``(-period/2, period/2]``.

    ::

        wrap(x) = x - p ceil(x/p - 1/2)

    Parameters
    ----------
    angle : array_like
        Any shape; NaN and infinities give NaN.
    period : float
        One turn in the unit of ``angle``.

    Returns
    -------
    ndarray of float64
        Same shape. Exact for angles within half a turn, else within one rounding
        of ``angle``.

    Examples
    --------
    >>> wrap([190.0, -180.0, 360.5], period=360.0)
    array([-170. ,  180. ,    0.5])
    """
    x = np.asarray(angle, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        wrapped = x - period * np.ceil(x / period - 0.5)
    # x / period may round across the half turn: put such values back inside.
    half = 0.5 * period
    wrapped = np.where(wrapped <= -half, wrapped + period, wrapped)
    return np.where(wrapped > half, wrapped - period, wrapped)


def unwrapped(angle: ArrayLike, period: float = 2.0 * math.pi) -> NDArray[np.float64]:
    """``angle`` without jumps at 0/period: a step is at most half a turn.

    Angles that cover more than one turn are not wrapped, and stay as they are: positions
    12.05 turns apart are that far apart. The outermost twentieth, and at least one reading, at
    each end do not count: they may be outliers.

    Examples
    --------
    >>> unwrapped([350.0, 10.0, 30.0], 360.0).tolist()
    [350.0, 370.0, 390.0]
    >>> unwrapped([0.0, 4338.0, 8676.0, 13014.0], 360.0).tolist()
    [0.0, 4338.0, 8676.0, 13014.0]
    """
    values = np.asarray(angle, dtype=np.float64)
    ascending = np.sort(values)
    outer = values.size // 20 + 1
    if values.size > outer and ascending[-1 - outer] - ascending[outer] > period:
        return values
    return np.unwrap(values, period=period)


def circular_mean(
    angle: ArrayLike, period: float = 2.0 * math.pi, weights: ArrayLike | None = None
) -> float:
    """Direction of the mean of unit vectors at ``angle``, in ``(-period/2, period/2]``.

    In contrast to the arithmetic mean it does not depend on where the turn is cut.

    Examples
    --------
    >>> round(circular_mean([359.0, 3.0], period=360.0), 9)
    1.0
    """
    turns = np.asarray(angle, dtype=np.float64) * (2.0 * math.pi / period)
    unit = np.exp(1j * turns)
    vector = unit.mean() if weights is None else (unit * np.asarray(weights)).sum()
    return float(wrap(np.angle(vector) * (period / (2.0 * math.pi)), period))


def power_sums(
    turns: NDArray[np.float64], columns: NDArray[np.float64], count: int
) -> NDArray[np.complex128]:
    """Sums of ``columns`` under the powers of points on the unit circle.

    ::

        S_mj = Σ_i c_ij e^(2π i m t_i),    m = 0, ..., count - 1

    ``turns`` (n,) are the angles of the points in turns, any number of them, ``columns`` is (n, k)
    and the result (count, k): to 1e-14 of the sums of ``abs(columns)``; O(n count k), by products
    of matrices.

    Examples
    --------
    >>> import numpy as np
    >>> sums = power_sums(np.arange(4) / 4.0, np.ones((4, 1)), 5)[:, 0]
    >>> (np.round(sums.real, 12) + 0.0).tolist()
    [4.0, 0.0, 0.0, 0.0, 4.0]
    """
    found = np.zeros((count, columns.shape[1]), dtype=np.complex128)
    for start in range(0, turns.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        within = turns[part] - np.floor(turns[part])
        step = np.exp(2j * math.pi * within)
        right = columns[part] + 0j
        for first in range(0, count, _RESEED):
            powers = np.empty((min(_RESEED, count - first), within.size), dtype=np.complex128)
            # The integer part of m * t costs digits and has no effect: it is subtracted first.
            phase = first * within
            powers[0] = np.exp(2j * math.pi * (phase - np.round(phase)))
            filled, stride = 1, step
            while filled < len(powers):
                more = powers[filled : 2 * filled]
                np.multiply(powers[: len(more)], stride, out=more)
                filled, stride = 2 * filled, stride * stride
            found[first : first + len(powers)] += powers @ right
    return found
