"""The rotor as an inertia: what moves it in addition to the commanded speed of a run.

::

    θ̈ = -γθ̇ + c sin(mθ + φ) + u sin(θ + ψ) + f(t) + a

with viscous friction ``γ`` (none at constant speed), cogging, imbalance and a friction
that drifts, all as accelerations, and ``a`` the acceleration that a velocity loop commands. The
loop is closed on the encoder under test: with what the encoder reads, r, and its speed,

::

    a = ω_b (ṙ₀ - ṙ) + 1/4 ω_b² (r₀ - r),
    T(s) = (ω_b s + ω_b²/4) / ((s + ω_b/2)²),

so that the shaft moves by ``-Tε`` and the log shows ``(1 - T)ε``.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..joint.pattern import Pattern
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array

ARCSEC_PER_RAD: Final = ARCSEC_PER_TURN / (2.0 * math.pi)


class RotorDrive(NamedTuple):
    """What moves a shaft, in radians and seconds; the friction that drifts, in deg/s^2."""

    place: float
    speed: float
    decay: float
    cogging: float
    order: float
    phase: float
    imbalance: float
    low: float
    band: float
    friction_deg_s2: float
    memory_s: float


class RotorMotion(NamedTuple):
    """Angle (deg), speed (deg/s) and acceleration by the motor (deg/s^2) at every reading."""

    angle: Array
    speed: Array
    driven: Array


def rotor_angle(
    drive: RotorDrive, time: Array, pattern: Pattern, rng: np.random.Generator
) -> RotorMotion:
    """Where the shaft is at ``time``, integrated from the start of the run.

    Parameters
    ----------
    drive : Drive
    time : ndarray
        Seconds, ascending from the start of the run.
    pattern : Pattern
        Lines that the loop sees; other effects and noise do not move the shaft.
    rng : numpy.random.Generator
        Of the friction that drifts.

    Raises
    ------
    ArgumentError
        The shaft runs away.
    """
    place, start, rate, cogging, order, phase, imbalance, low, band, *_ = drive
    viscous = 0.0 if band else rate  # a loop gives what friction takes
    lines = (
        [
            (m, complex(a, -b) / ARCSEC_PER_RAD)
            for m, a, b in zip(
                pattern.orders.tolist(),
                pattern.cosine.tolist(),
                pattern.sine.tolist(),
                strict=True,
            )
        ]
        if band
        else []
    )

    def seen(x: float) -> tuple[float, float]:
        """The pattern at ``x`` and its slope."""
        value = slope = 0.0
        for m, line in lines:
            term = line * complex(math.cos(m * x), math.sin(m * x))
            value += term.real
            slope -= m * term.imag
        return value, slope

    zero = seen(place)[0]

    def loop(t: float, x: float, v: float) -> float:
        value, slope = seen(x)
        wanted = start * math.exp(-rate * t)
        way = start * t if rate == 0.0 else start * -math.expm1(-rate * t) / rate
        reading = x + value - zero - place
        lag = band * (wanted - v * (1.0 + slope)) + 0.25 * band * band * (way - reading)
        return lag - rate * wanted

    def pushed(x: float, v: float) -> float:
        a = -viscous * v
        if cogging:
            a += cogging * math.sin(order * x + phase)
        if imbalance:
            a += imbalance * math.sin(x + low)
        return a

    fastest = max([order if cogging else 1.0, *(m for m, _ in lines)])
    # Radians that the fastest term turns by in one step of the integration, at most: Runge and
    # Kutta's rule of fourth order is then right to some 1e-6 of what the term moves.
    longest = 0.1 / max(fastest * abs(start) * max(1.0, math.exp(-rate * time[-1])), band, 1e-12)
    friction = np.radians(_drift(drive, time, rng)).tolist()
    n = time.size
    angle, speed, driven = np.empty(n), np.empty(n), np.zeros(n)
    x, v, before = place, start, 0.0
    for i, now in enumerate(time.tolist()):
        f = friction[i]
        steps = max(1, math.ceil((now - before) / longest))
        h = (now - before) / steps
        for j in range(steps if h > 0.0 else 0):
            t = before + j * h
            a1 = f + pushed(x, v)
            x2, v2 = x + 0.5 * h * v, v + 0.5 * h * a1
            if band:
                a1 += loop(t, x, v)
                v2 = v + 0.5 * h * a1
                a2 = f + pushed(x2, v2) + loop(t + 0.5 * h, x2, v2)
                x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
                a3 = f + pushed(x3, v3) + loop(t + 0.5 * h, x3, v3)
                x4, v4 = x + h * v3, v + h * a3
                a4 = f + pushed(x4, v4) + loop(t + h, x4, v4)
            else:
                a2 = f + pushed(x2, v2)
                x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
                a3 = f + pushed(x3, v3)
                x4, v4 = x + h * v3, v + h * a3
                a4 = f + pushed(x4, v4)
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not abs(v) < 1e9:
            raise ArgumentError("the shaft runs away: make cogging, imbalance and loop weaker")
        angle[i], speed[i] = x, v
        if band:
            driven[i] = loop(now, x, v)
        before = now
    return RotorMotion(np.degrees(angle), np.degrees(speed), np.degrees(driven))


def _drift(drive: RotorDrive, time: Array, rng: np.random.Generator) -> Array:
    """A friction's acceleration at every reading, with the correlation time ``memory_s``."""
    size = drive.friction_deg_s2
    if size == 0.0:
        return np.zeros(time.size)
    keep = np.exp(-np.diff(time, prepend=time[0]) / drive.memory_s)
    shocks = rng.standard_normal(time.size) * size
    found, state = np.empty(time.size), float(shocks[0])
    fresh = np.sqrt(1.0 - keep**2) * shocks
    for i, (k, new) in enumerate(zip(keep.tolist(), fresh.tolist(), strict=True)):
        state = k * state + (new if i else 0.0)
        found[i] = state
    return found
