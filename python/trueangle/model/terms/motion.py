"""What follows the velocity: a delay, a filter, a skew of channels, a line that varies with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from .. import forms
from ..forms import Form
from ..term import Term


@dataclass(frozen=True, repr=False)
class LatencyTerm(Term):
    """The indicated angle is a time ``τ`` old.

    ::

        indicated(t) = θ(t - τ) + ε(θ(t - τ))

    so ``φ = θ - vτ`` is solved for and ``vτ`` added. Exact at
    constant velocity; an acceleration a leaves ``aτ²/2``.

    Parameters
    ----------
    delay_s : float
        ``τ`` in seconds; negative where the reference is the later one.
    """

    delay_s: float

    kind: ClassVar[str] = "latency"
    signals: ClassVar[tuple[str, ...]] = ("velocity",)

    def forms(self) -> tuple[Form, ...]:
        return (forms.Lag(self.delay_s),)


@dataclass(frozen=True, repr=False)
class FilterLagTerm(Term):
    """The harmonics behind a low-pass that has no ramp error.

    At v turns per second a line of output order m is multiplied by
    ``1/(1 + j m v/f_c)`` or, with damping ``ζ``, by
    ``1/(1 - w² + 2 j ζ w)`` with ``w = m v/(2 ζ f_c)``. Exact at constant
    velocity; after a change of velocity the filter itself needs about
    ``1/(2π f_c)`` to follow.

    Parameters
    ----------
    cutoff_hz : float
        ``f_c > 0``.
    damping : float, optional
        ``ζ > 0`` of a filter of second order.
    """

    cutoff_hz: float
    damping: float | None = None

    kind: ClassVar[str] = "filter_lag"
    signals: ClassVar[tuple[str, ...]] = ("velocity",)
    optional: ClassVar[tuple[str, ...]] = ("damping",)
    is_built_on_harmonics: ClassVar[bool] = True

    def check(self) -> None:
        if self.cutoff_hz <= 0.0:
            raise self._out_of_range("cutoff_hz", "positive")
        if self.damping is not None and self.damping <= 0.0:
            raise self._out_of_range("damping", "positive")

    def forms(self) -> tuple[Form, ...]:
        if self.damping is None:
            return (forms.Filter(self.cutoff_hz),)
        return (forms.Filter(2.0 * self.damping * self.cutoff_hz, self.damping),)


@dataclass(frozen=True, repr=False)
class ChannelSkewTerm(Term):
    """Half of the way during the delay, and the line at twice the sensor's order.

    ::

        ε = (v Δt / 2) [1 + sin(mφ + φ₀)]

    Parameters
    ----------
    delay_s : float
        ``Δt``.
    order : float
        m > 0, of the output.
    phase_deg : float
        ``φ₀``, degrees.
    """

    delay_s: float
    order: float
    phase_deg: float = 0.0

    kind: ClassVar[str] = "channel_skew"
    signals: ClassVar[tuple[str, ...]] = ("velocity",)

    def check(self) -> None:
        if self.order <= 0.0:
            raise self._out_of_range("order", "positive")

    @property
    def is_periodic(self) -> bool:
        return self.order == int(self.order)

    def mirrored(self) -> Self:
        return replace(self, phase_deg=180.0 - self.phase_deg)

    def forms(self) -> tuple[Form, ...]:
        half, phase = 0.5 * self.delay_s, math.radians(self.phase_deg)
        line = (self.order, half * math.sin(phase), half * math.cos(phase))
        return (forms.Scaled("velocity", half, (line,)),)


@dataclass(frozen=True, repr=False)
class VaryingLineTerm(Term):
    """A line times a signal.

    ::

        ε = x Σ_m A_m cos mφ + B_m sin mφ

    Parameters
    ----------
    orders, cosine, sine : sequence of float
        Output orders (positive) and coefficients per unit of x.
    follows : {"speed", "velocity", "torque"}
        x: the absolute or the signed velocity in the model's unit, or the torque in Nm.
    """

    orders: tuple[float, ...]
    cosine: tuple[float, ...]
    sine: tuple[float, ...]
    follows: str = "velocity"

    kind: ClassVar[str] = "varying_line"

    @property
    def odd(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("sine",) if self.follows == "velocity" else ("cosine",)

    @property
    def needs(self) -> tuple[str, ...]:
        return ("torque",) if self.follows == "torque" else ("velocity",)

    def check(self) -> None:
        self._check_lines()
        if self.follows not in ("speed", "velocity", "torque"):
            raise self._out_of_range("follows", "'speed', 'velocity' or 'torque'")

    def forms(self) -> tuple[Form, ...]:
        (signal,) = self.needs
        return (forms.Scaled(signal, lines=self.lines, absolute=self.follows == "speed"),)
