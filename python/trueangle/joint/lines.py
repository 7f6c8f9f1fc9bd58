"""Cosine and sine of orders at angles."""

from __future__ import annotations

import numpy as np

import trueangle._core as _core

from ..support.arrays import Array

#: Rounding of angles of some hundred turns, per order.
VANISHES = 1e-11


def line_columns(theta: Array, order: float) -> Array:
    """``cos`` and ``sin`` of ``order * theta``, shape (n, 2).

    One that vanishes at every reading (the sine of order 18 on 36 positions) is exactly 0:
    its rounding is no regressor.
    """
    return lines_columns(theta, np.array([order], dtype=np.float64))


def lines_columns(theta: Array, orders: Array) -> Array:
    """`line_columns` of many orders side by side, shape (n, 2 k)."""
    return _core.line_columns(np.ascontiguousarray(theta), orders, vanishing=VANISHES)


def line_sum(theta: Array, lines: tuple[tuple[float, float, float], ...]) -> Array:
    """Sum of ``(order, amplitude, phase_deg)`` as ``C sin(m theta + phase)``."""
    out = np.zeros_like(theta)
    for order, amplitude, phase in lines:
        out += amplitude * np.sin(order * theta + np.radians(phase))
    return out
