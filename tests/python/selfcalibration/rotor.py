"""A free rotor on which an encoder sits: equations of motion integrated, nothing the fit knows.

Torque ripple, friction that wanders, gravity and a velocity loop closed on the encoder act on
an inertia; the encoder reads the shaft with its error and noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

ARCSEC = np.pi / 648_000.0


def encoder(theta: np.ndarray, lines: Mapping[int, tuple[float, float]]) -> np.ndarray:
    """``sum C sin(k theta + phi)``: amplitude in arcsec, phase in radians, by order."""
    return sum(
        (c * ARCSEC * np.sin(k * theta + phi) for k, (c, phi) in lines.items()),
        np.zeros_like(theta),
    )


def coefficients(lines: Mapping[int, tuple[float, float]]) -> np.ndarray:
    """Cosine and sine of each order in turn, arcsec."""
    pairs = [(c * np.sin(phi), c * np.cos(phi)) for c, phi in lines.values()]
    return np.array(pairs).ravel()


def coast(
    start: float,
    stop: float,
    seconds: float,
    rate: float = 1000.0,
    *,
    ripple: Mapping[int, float] | None = None,
    wander: float = 0.0,
    memory: float = 2.0,
    rng: np.random.Generator | None = None,
    steps: int = 4,
) -> tuple[np.ndarray, np.ndarray]:
    """Time and angle of a rotor that coasts from one speed to another (turns per second).

    ``ripple``: acceleration amplitude (rad/s^2) by order of the shaft; ``wander``: rms of a
    friction acceleration that forgets itself in ``memory`` seconds. Runge-Kutta of order 4.
    """
    n = round(seconds * rate)
    t = np.arange(n) / rate
    decay = np.log(start / stop) / seconds if start != stop else 0.0
    ripple = dict(ripple or {})
    if wander:
        assert rng is not None
        keep = np.exp(-1.0 / (rate * memory))
        shocks = rng.normal(size=n) * wander * np.sqrt(1.0 - keep**2)
        friction = np.empty(n)
        friction[0] = rng.normal() * wander
        for i in range(1, n):
            friction[i] = keep * friction[i - 1] + shocks[i]
    else:
        friction = np.zeros(n)

    def acceleration(x: float, v: float, extra: float) -> float:
        a = -decay * v + extra
        for k, size in ripple.items():
            a += size * np.cos(k * x + 0.7)
        return a

    if not ripple and not wander:
        v0 = 2.0 * np.pi * start
        return t, v0 / decay * (1.0 - np.exp(-decay * t)) if decay else v0 * t
    h = 1.0 / (rate * steps)
    x, v = 0.0, 2.0 * np.pi * start
    angle = np.empty(n)
    for i in range(n):
        angle[i] = x
        f = friction[i]
        for _ in range(steps):
            a1 = acceleration(x, v, f)
            a2 = acceleration(x + 0.5 * h * v, v + 0.5 * h * a1, f)
            a3 = acceleration(x + 0.5 * h * (v + 0.5 * h * a1), v + 0.5 * h * a2, f)
            v3 = v + 0.5 * h * a2
            a4 = acceleration(x + h * v3, v + h * a3, f)
            x, v = (
                x + h * v + h * h / 6.0 * (a1 + a2 + a3),
                v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
            )
    return t, angle


def held_by_loop(
    speed: float,
    bandwidth: float,
    seconds: float,
    lines: Mapping[int, tuple[float, float]],
    rate: float = 1000.0,
    sense: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, angle and motor acceleration of a shaft whose speed is held by the encoder itself.

    A PI velocity loop of crossover ``bandwidth`` (Hz) on the differenced reading.
    """
    n = round(seconds * rate)
    t = np.arange(n) / rate
    wb = 2.0 * np.pi * bandwidth
    target = 2.0 * np.pi * speed
    angle, command = np.empty(n), np.empty(n)
    x, v = 0.0, target
    lead = 0.0
    for i in range(n):
        angle[i] = x
        reading = x + float(encoder(np.array([x]), lines)[0])
        if i == 0:
            lead = reading
        # Position and velocity form of the PI loop, on what the encoder says.
        wanted = lead + target * t[i]
        slope = 1.0 + sum(k * c * ARCSEC * np.cos(k * x + phi) for k, (c, phi) in lines.items())
        a = wb * (target - v * slope) + 0.25 * wb * wb * (wanted - reading)
        command[i] = a
        v += a / rate
        x += v / rate
    del sense
    return t, angle, command
