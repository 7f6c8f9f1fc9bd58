"""What follows the direction of travel: play, as it is or by the place, and friction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .. import forms
from ..forms import Form
from ..term import Term


@dataclass(frozen=True, repr=False)
class BacklashTerm(Term):
    """Play of the gear, b in the direction of travel d, and how it varies with the place.

    ::

        ε = d [b + Σ_m A_m cos mφ + B_m sin mφ]

    The direction d is the sign of ``direction`` or ``velocity`` where one is given (0 keeps
    the last one). Otherwise it is that of the indicated angle, through the play operator:
    the joint is assumed at rest until the indicated angle has crossed the whole play 2b.
    Before the first motion ``d = 0``, the middle of the play.

    Parameters
    ----------
    half_width : float
        b: half of the error forward minus the error backward, on average over a turn. Play
        that is negative somewhere (the reference's own) needs a direction, because the
        angle alone does not determine it.
    orders, cosine, sine : sequence of float
        How the play varies with the place: output orders m, and coefficients.
    """

    half_width: float
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    kind: ClassVar[str] = "backlash"
    odd: ClassVar[tuple[str, ...]] = ("sine",)
    follows_travel: ClassVar[bool] = True
    optional: ClassVar[tuple[str, ...]] = ("orders", "cosine", "sine")

    def check(self) -> None:
        self._check_lines()

    @property
    def needs(self) -> tuple[str, ...]:
        swing = sum(math.hypot(a, b) for a, b in zip(self.cosine, self.sine, strict=True))
        return ("direction",) if self.half_width - swing < 0.0 else ()

    def forms(self) -> tuple[Form, ...]:
        return (forms.Play(self.half_width, self.lines),)


@dataclass(frozen=True, repr=False)
class DirectionalPatternTerm(Term):
    """Play that differs from place to place, without its mean.

    ::

        ε = d Σ_m A_m cos mφ + B_m sin mφ

    It needs the direction of travel d (or the velocity), which the angle alone does not
    determine where the play is negative.

    Parameters
    ----------
    orders, cosine, sine : sequence of float
        Output orders (positive) and coefficients.
    """

    orders: tuple[float, ...]
    cosine: tuple[float, ...]
    sine: tuple[float, ...]

    kind: ClassVar[str] = "direction_dependent_pattern"
    odd: ClassVar[tuple[str, ...]] = ("sine",)
    signals: ClassVar[tuple[str, ...]] = ("direction",)
    follows_travel: ClassVar[bool] = True

    def check(self) -> None:
        self._check_lines()

    def forms(self) -> tuple[Form, ...]:
        return (forms.Play(0.0, self.lines),)


@dataclass(frozen=True, repr=False)
class PreslidingHysteresisTerm(Term):
    """Friction that winds the gear up over a length: ``ε = h z(s)``.

    ::

        dz / ds = (d - z) / L,    z(s) = d - (d - z₀) e^(-s/L)

    for travel s since the last reversal, where the state was ``z₀`` (Dahl); after
    long travel ``z₀ = -d`` and ``z = d (1 - 2e^(-s/L))``. Several elements of
    different lengths add up to a Maxwell-slip model.

    Parameters
    ----------
    amplitude : float
        h: half of the reversal error far from the reversal.
    length : float
        L > 0: travel in which it builds up.
    start : float
        Share of the wind-up that is there at the first motion, in its direction: 0 for a
        relaxed joint, 1 for one that has been run in.

    Notes
    -----
    Without ``direction`` or ``velocity`` every step back is travel: noise at rest then
    wears the state down. Give one of them where the joint rests between motions.
    """

    amplitude: float
    length: float
    start: float = 0.0

    kind: ClassVar[str] = "presliding_hysteresis"
    follows_travel: ClassVar[bool] = True

    def check(self) -> None:
        if self.length <= 0.0:
            raise self._out_of_range("length", "positive")
        if not 0.0 <= self.start <= 1.0:
            raise self._out_of_range("start", "from 0 to 1")

    def forms(self) -> tuple[Form, ...]:
        return (forms.Friction(self.amplitude, self.length, self.start),)
