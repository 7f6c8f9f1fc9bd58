"""Forms that the compiled core corrects by: play, friction, lag, filter, scaled, spring, bump.

They have no physical names: a term states what it represents and which forms it takes.
Angles are in the unit of the model's period; lines are ``(order, cosine, sine)`` with the
output order and ``cosine cos + sine sin``.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

Lines: TypeAlias = tuple[tuple[float, float, float], ...]


class Play(NamedTuple):
    """``direction * (half_width + lines)``."""

    half_width: float
    lines: Lines = ()


class Friction(NamedTuple):
    """``amplitude * z`` with ``dz/ds = (direction - z) / length`` over travel s."""

    amplitude: float
    length: float
    start: float = 0.0


class Lag(NamedTuple):
    """The indicated angle is that of ``delay`` seconds ago."""

    delay: float


class Filter(NamedTuple):
    """The harmonics behind a low-pass without a ramp error, less the harmonics.

    Of first order with the corner ``frequency``, or of second order with that natural
    frequency and ``damping``.
    """

    frequency: float
    damping: float | None = None


class Scaled(NamedTuple):
    """``(signal - origin) * (level + relative * harmonics + lines)``; or its absolute value."""

    signal: str
    level: float = 0.0
    lines: Lines = ()
    relative: float = 0.0
    origin: float = 0.0
    absolute: bool = False


class Spring(NamedTuple):
    """``linear m + cubic m^3 + beyond sign(m) max(|m| - knee, 0)``.

    m is the signal or, with ``gravity``, the signal times ``sin(angle - gravity)``.
    """

    signal: str
    linear: float = 0.0
    cubic: float = 0.0
    beyond: float = 0.0
    knee: float = 0.0
    gravity: float | None = None


class Bump(NamedTuple):
    """``height exp(-(a - place)^2 / (2 width^2))`` at the angle ``a = cycles * angle``."""

    place: float
    width: float
    height: float
    cycles: float = 1.0


class Ramp(NamedTuple):
    """``slope * (x - middle)`` from ``start`` to ``stop``, and beyond them what it is there."""

    slope: float
    start: float
    stop: float


Form: TypeAlias = Play | Friction | Lag | Filter | Scaled | Spring | Bump | Ramp
