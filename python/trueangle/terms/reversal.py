"""Reversal errors: backlash and presliding hysteresis, by direction of travel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from .term import Term, from_arcsec

__all__ = ["Backlash", "PreslidingHysteresis"]


@dataclass(frozen=True)
class Backlash(Term):
    r"""Play of the gear: :math:`\varepsilon = b\,d` with the direction of travel d.

    The direction is the sign of ``direction`` or ``velocity`` where one is given (0 keeps
    the last one). Otherwise it is that of the indicated angle, through the play operator:
    the joint is taken to stand until the indicated angle has crossed the whole play 2b.
    Before the first motion :math:`d = 0`, the middle of the play.

    Parameters
    ----------
    half_width : float
        b: half of the error forward minus the error backward. A negative one (the
        reference's own play) needs a direction, for the angle alone does not tell it.
    """

    half_width: float

    kind: ClassVar[str] = "backlash"
    follows_travel: ClassVar[bool] = True

    @property
    def needs(self) -> tuple[str, ...]:
        return ("direction",) if self.half_width < 0.0 else ()

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(from_arcsec(table["half_width_arcsec"], period))


@dataclass(frozen=True)
class PreslidingHysteresis(Term):
    r"""Friction that winds the gear up over a length: :math:`\varepsilon = h\,z(s)`.

    .. math:: \frac{dz}{ds} = \frac{d - z}{L},\qquad z(s) = d - (d - z_0)\,e^{-s/L}

    for travel s since the last reversal, where the state was :math:`z_0` (Dahl); after a
    long stretch :math:`z_0 = -d` and :math:`z = d\,(1 - 2e^{-s/L})`. Several elements of
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

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(
            from_arcsec(table["amplitude_arcsec"], period),
            table["length_deg"] * (period / 360.0),
            table.get("start_state", 0.0),
        )
