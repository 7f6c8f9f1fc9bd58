"""Harmonics, their lines and the pattern they add up to; the joint with its pattern."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..errors import ArgumentError
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from .joint import Joint

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


ARCSEC_PER_RAD = 1_296_000.0 / (2.0 * math.pi)


@told_kinds
@dataclass(frozen=True)
class Harmonic:
    """One line: ``C sin(k f θ + φ)`` of a shaft that turns f times.

    Parameters
    ----------
    shaft : str
        "output", "motor", "wave_generator" or a shaft that the joint declares.
    order : int or float
        Cycles per turn of that shaft.
    amplitude_arcsec : float
    phase_deg : float

    Examples
    --------
    >>> Harmonic("output", 1, 10.0, 90.0).coefficients
    (10.0, 0.0)
    """

    shaft: str
    order: float
    amplitude_arcsec: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        if not self.order > 0:
            raise ArgumentError(f"order must be positive, got {self.order!r}")

    @property
    def coefficients(self) -> tuple[float, float]:
        """``(A, B)`` of ``A cos + B sin``, arcsec, rounded to 1e-12 of the amplitude."""
        phase = math.radians(self.phase_deg)
        grain = 12
        return (
            self.amplitude_arcsec * round(math.sin(phase), grain),
            self.amplitude_arcsec * round(math.cos(phase), grain),
        )


@dataclass(frozen=True, eq=False)
class Pattern:
    """Sum of lines as a function of the output angle in radians, arcsec.

    ::

        p(θ) = Σ_m A_m cos mθ + B_m sin mθ

    Parameters
    ----------
    orders, cosine, sine : ndarray, shape (k,)
        Output orders (any positive reals) and coefficients.

    Examples
    --------
    >>> lines = Pattern.of([Harmonic("motor", 2, 3.0)], Joint(50.0, "circular_spline", "motor"))
    >>> lines.orders
    array([100.])
    """

    orders: Array
    cosine: Array
    sine: Array

    @classmethod
    def of(cls, harmonics: Iterable[Harmonic], joint: Joint) -> Pattern:
        """Pattern of ``harmonics``; equal output orders are added up."""
        total: dict[float, complex] = {}
        for line in harmonics:
            a, b = line.coefficients
            order = joint.output_order(line.shaft, line.order)
            total[order] = total.get(order, 0j) + complex(a, b)
        values = list(total.values())
        return cls(
            np.array(list(total), dtype=np.float64),
            np.array([value.real for value in values], dtype=np.float64),
            np.array([value.imag for value in values], dtype=np.float64),
        )

    def _lines(self, theta: Array) -> tuple[Array, Array, Array, Array]:
        parts = (np.ravel(theta), self.orders, self.cosine, self.sine)
        theta, orders, a, b = (np.ascontiguousarray(part, dtype=np.float64) for part in parts)
        return theta, orders, a, b

    def value(self, theta: Array) -> Array:
        """p(theta), arcsec."""
        return _core.line_sum(*self._lines(theta)).reshape(np.shape(theta))

    def value_and_slope(self, theta: Array) -> tuple[Array, Array]:
        """p(theta) and dp/dtheta, arcsec per arcsec (no unit)."""
        value, slope = _core.line_sum_and_slope(*self._lines(theta)).reshape(2, *np.shape(theta))
        return value, slope / ARCSEC_PER_RAD

    def passed(
        self,
        theta: Array,
        turns_per_s: Array,
        response: Callable[[Array], NDArray[np.complex128]],
    ) -> Array:
        """The pattern as measured through a filter while moving.

        ``response(f)`` is the filter's complex gain at the signed frequency f in Hz;
        a line of order m at v turns per second is at ``m v``.
        """
        out = np.zeros_like(theta)
        for order, a, b in zip(self.orders, self.cosine, self.sine, strict=True):
            gain = response(order * turns_per_s)
            # A cos + B sin is the real part of (A - iB) exp(i m theta).
            out += (complex(a, -b) * gain * np.exp(1j * order * theta)).real
        return out

    def indicated_value(self, theta: Array, steps: int = 30) -> Array:
        """Solution e of ``e = p(theta + e)``: the pattern evaluated at the indicated angle.

        By Newton's steps; where the pattern is about as steep as the angle at a reading, which
        that of no joint is, by putting e in.
        """
        sizes = np.hypot(self.cosine, self.sine)
        steepest = float(self.orders @ sizes) / ARCSEC_PER_RAD
        # What a step of Newton leaves of its own square.
        bend = 0.5 * float(self.orders**2 @ sizes) / ARCSEC_PER_RAD**2 / max(1.0 - steepest, 0.1)
        error = self.value(theta)
        for _ in range(steps):
            value, slope = self.value_and_slope(theta + error / ARCSEC_PER_RAD)
            change = value - error
            is_gentle = steepest < STEEP or float(np.max(np.abs(slope), initial=0.0)) < STEEP
            if is_gentle:
                change = change / (1.0 - slope)
            error = error + change
            largest = float(np.max(np.abs(change), initial=0.0))
            if min(largest, bend * largest**2 if is_gentle else np.inf) < SOLVED:
                break
        return error


@dataclass(frozen=True)
class JointPattern:
    """What an effect may depend on beyond the readings: the joint and its pattern."""

    joint: Joint
    pattern: Pattern


#: Slope from which on Newton's steps may lead away.
STEEP = 0.9

#: Arcsec that are left of an equation when it counts as solved: below any encoder's rounding.
SOLVED = 1e-9
