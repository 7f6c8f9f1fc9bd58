"""Run lengths of cumulative-sum charts, and the limits that give them."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..errors import ArgumentError
from .argumentkinds import told_kinds
from .distributions import normal_tail


@told_kinds
def run_length(allowance: float, limit: float, shift: float = 0.0) -> float:
    """Values until a two-sided cumulative sum alarms, on average.

    A one-sided sum from z has the mean run length (Page's integral equation)

    ::

        L(z) = 1 + L(0) Φ(k - z - δ) + ∫_0^h L(y) φ(y + k - z - δ) dy,

    and the two sides together ``1/L = 1/L⁺ + 1/L⁻`` (Kemp 1961).

    Parameters
    ----------
    allowance : float
        k, in standard deviations of a value.
    limit : float
        h, likewise.
    shift : float
        Of the mean.

    Returns
    -------
    float

    Raises
    ------
    ArgumentError
        A limit that is not positive.

    Examples
    --------
    >>> [round(run_length(0.5, 5.0, shift), 2) for shift in (0.0, 0.5, 1.0)]
    [465.44, 38.0, 10.38]
    """
    if not limit > 0.0:
        raise ArgumentError(f"limit must be positive, got {limit!r}")
    sides = [_one_sided(allowance, limit, way) for way in (shift, -shift)]
    return 1.0 / (1.0 / sides[0] + 1.0 / sides[1])


def _one_sided(allowance: float, limit: float, shift: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(64)
    places = 0.5 * limit * (nodes + 1.0)
    weights = 0.5 * limit * weights
    starts = np.concatenate([[0.0], places])
    back = np.array([normal_tail(-(allowance - z - shift)) for z in starts])
    density = np.exp(-0.5 * (places[None, :] + allowance - shift - starts[:, None]) ** 2)
    system = np.eye(starts.size)
    system[:, 0] -= back
    system[:, 1:] -= density * weights / math.sqrt(2.0 * math.pi)
    return float(np.linalg.solve(system, np.ones(starts.size))[0])


@lru_cache(maxsize=64)
def chart_limit(allowance: float, length: float) -> float:
    """The limit at which a two-sided sum alarms once in ``length`` values without a change.

    Examples
    --------
    >>> round(chart_limit(0.5, 465.44), 3), round(chart_limit(0.5, 4 * 465.44), 2)
    (5.0, 6.38)
    """
    low, high = 1e-3, 1.0
    while run_length(allowance, high) < length:
        low, high = high, 2.0 * high
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if run_length(allowance, middle) < length else (low, middle)
    return high
