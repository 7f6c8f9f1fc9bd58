"""Least-squares knots of tables, also of one turn: the best continuous line or cubic.

Linear interpolation of exact samples leaves ``h²|g''|/√120`` rms; the continuous
piecewise line that is nearest in the mean square leaves ``h²|g''|/√720``, a factor
2.45 less from a table of the same size. The basis functions of one knot are those of its
neighbour shifted, so the normal equations are block-circulant and one FFT solves them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .pattern import TurnPattern

Function = Callable[[Array], Array]

#: Gauss points per segment: a cubic times a function whose shortest wave is two segments.
_POINTS = 16


def linear_knots(g: Function, entries: int) -> Array:
    """Values at ``i / entries`` of the continuous piecewise line nearest to ``g``.

    Parameters
    ----------
    g : callable
        Of angles in turns; one turn is its period.
    entries : int

    Returns
    -------
    ndarray, shape (entries,)

    Examples
    --------
    >>> knots = linear_knots(lambda x: np.cos(2 * np.pi * x), 64)
    >>> round(float(knots[0]), 4)  # outside the function where it bends
    1.0008
    """
    return _nearest(g, entries, 1)[:, 0]


def cubic_knots(g: Function, entries: int) -> Array:
    """Values, and slopes per segment, of the smooth piecewise cubic nearest to ``g``.

    Returns
    -------
    ndarray, shape (entries, 2)
    """
    return _nearest(g, entries, 2)


def rounded_knots(knots: Array) -> Array:
    """Whole numbers whose lines are nearest to the lines between ``knots``.

    Errors ``e_i`` of the knots leave ``Σ 2/3 e_i² + 1/3 e_i e_{i+1}``
    between them, so neighbours that err to opposite sides leave less: each knot is rounded for
    what its neighbours have left, until none changes. Never worse than rounding each alone.

    Examples
    --------
    >>> rounded_knots(np.array([0.47, 0.47, 0.47, 0.47]))
    array([1., 0., 1., 0.])
    """
    count = len(knots)
    found = np.rint(knots)
    # Knots that are no neighbours of each other are moved at once.
    groups = [np.arange(0, count - 1, 2), np.arange(1, count, 2), np.arange(count - 1, count)]
    # Sweeps after which rounding ends; each lowers the error, and ten are enough.
    for _ in range(50):
        before = found.copy()
        for group in groups:
            error = found - knots
            pull = (error[group - 1] + error[(group + 1) % count]) / 4.0
            moved = np.rint(knots[group] - pull)
            # Farthest that a knot is moved from where it should be, in units of its last digit: a
            # little beyond the half takes most of the gain in rms, and the maximum grows with it.
            near = np.abs(moved - knots[group]) <= 0.55
            found[group] = np.where(near, moved, np.rint(knots[group]))
        if np.array_equal(found, before):
            break
    alone = np.rint(knots)
    return found if _left(found - knots) <= _left(alone - knots) else alone


def _left(error: Array) -> float:
    """What errors of knots leave between them, up to a factor."""
    return float(np.sum(error * (2.0 * error + np.roll(error, 1))))


def _basis(t: Array, count: int) -> tuple[Array, Array]:
    """Functions of a segment's lower and of its upper knot, ``(count, points)`` each."""
    if count == 1:
        return np.stack([1.0 - t]), np.stack([t])
    lower = np.stack([(1.0 + 2.0 * t) * (1.0 - t) ** 2, t * (1.0 - t) ** 2])
    upper = np.stack([t**2 * (3.0 - 2.0 * t), t**2 * (t - 1.0)])
    return lower, upper


def _nearest(g: Function, entries: int, count: int) -> Array:
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    t, w = (nodes + 1.0) / 2.0, weights / 2.0
    values = g((np.arange(entries)[:, None] + t).ravel() / entries).reshape(entries, _POINTS)
    lower, upper = _basis(t, count)
    right = (values * w) @ lower.T + np.roll((values * w) @ upper.T, 1, axis=0)
    same = (lower * w) @ lower.T + (upper * w) @ upper.T
    following = (lower * w) @ upper.T  # of a knot with the next one
    turn = np.exp(2j * np.pi * np.arange(entries) / entries)[:, None, None]
    matrix = same + following * turn + following.T * np.conj(turn)
    solved = np.linalg.solve(matrix, np.fft.fft(right, axis=0)[:, :, None])
    return np.asarray(np.fft.ifft(solved[:, :, 0], axis=0).real)


def one_turn_knots(
    pattern: TurnPattern, entries: int, target: str, most: int = 0, binary: bool = False
) -> Array:
    """Least-squares knots, in turns, of the correction of a reading.

    A table may have up to ``most`` entries (0: no other number), or a ``binary`` number of them: a
    power of two.

    Raises
    ------
    ArgumentError
        Orders that the table cannot hold, or shafts of which it holds no whole turn.
    """
    pattern.check_one_turn(target)
    some = (1 << k for k in range(2, most.bit_length())) if binary else range(4, most + 1)
    pattern.check_orders(entries, target, some)
    return linear_knots(pattern.correction, entries)


def without_mean(knots: Array, pattern: TurnPattern) -> tuple[Array, float]:
    """Knots with their mean removed, and what the table then leaves to the zero, in degrees."""
    mean = float(np.mean(knots))
    return knots - mean, (mean + pattern.zero) * 360.0


def rounding_floor(step: float) -> float:
    """Arcsec rms between two rounded numbers: two thirds of the variance of each."""
    return step / math.sqrt(18.0) * ARCSEC_PER_TURN
