"""Play: a constant reversal error, and how it varies with the place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.estimate import Parameters, quantity
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import Surroundings, line_sum
from ..joint.signals import Signals
from ..model import forms
from ..model.forms import Form
from ..model.term import Term, from_arcsec, line_values
from .blindness import (
    Blindness,
)
from .effect import Effect
from .search import (
    Array,
    Fitted,
)

__all__ = ["Backlash", "BacklashTerm"]

ONE_WAY = "all runs go in one direction: a constant reversal error is part of the zero"


@dataclass(frozen=True)
class Backlash(Effect):
    r"""Constant reversal error: :math:`\varepsilon = b\,d`, d = direction of travel.

    Parameters
    ----------
    half_width_arcsec : float
        b: half of forward minus reverse, on average over a turn.
    lines : list of [output order, arcsec, phase_deg]
        How b varies with the place (as a cause of its own: a pattern of the direction).
    """

    half_width_arcsec: float
    lines: tuple[tuple[float, float, float], ...] = ()

    kind: ClassVar[str] = "backlash"
    sentence: ClassVar[str] = (
        "Play in the gear, a coupling or a key: the output lags by a constant angle "
        "whose sign is the direction of travel, whatever the speed, load and place."
    )
    factor: ClassVar[str] = "direction"
    measure: ClassVar[str] = "approach every position from both directions, within each run"
    acts_on_runs: ClassVar[bool] = True

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        width = self.half_width_arcsec + line_sum(signals.theta, self.lines)
        return np.asarray(width * signals.direction)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        columns = cls.columns(regression.signals, regression.around, {})
        return regression.propose(cls.kind, {}, columns)

    @classmethod
    def columns(cls, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return signals.direction[:, None]

    @classmethod
    def report(
        cls, regression: Regression, terms: Sequence[Fitted]
    ) -> tuple[Parameters, list[Effect]]:
        _, (width,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"half_width_arcsec": quantity(width, std)}, [Backlash(float(width))]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Blindness]) -> Iterator[Blindness]:
        if not goes_both_ways(regression.signals):
            yield cls.blind(ONE_WAY)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        width = from_arcsec(self.half_width_arcsec, period)
        return (BacklashTerm(width, **line_values(self.lines, period)),)


@dataclass(frozen=True, repr=False)
class BacklashTerm(Term):
    r"""Play of the gear, b in the direction of travel d, and how it varies with the place.

    .. math:: \varepsilon = d\,\bigl[b + \sum_m A_m \cos m\varphi + B_m \sin m\varphi\bigr]

    The direction d is the sign of ``direction`` or ``velocity`` where one is given (0 keeps
    the last one). Otherwise it is that of the indicated angle, through the play operator:
    the joint is taken to stand until the indicated angle has crossed the whole play 2b.
    Before the first motion :math:`d = 0`, the middle of the play.

    Parameters
    ----------
    half_width : float
        b: half of the error forward minus the error backward, on average over a turn. Play
        that is negative somewhere (the reference's own) needs a direction, for the angle
        alone does not tell it.
    orders, cosine, sine : sequence of float
        How the play varies with the place: output orders m, and coefficients.
    """

    half_width: float
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    kind: ClassVar[str] = "backlash"
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


def goes_both_ways(signals: Signals) -> bool:
    """The joint moved in both directions."""
    moving = signals.direction[signals.direction != 0.0]
    return moving.size > 0 and bool(np.ptp(moving) > 0.0)
