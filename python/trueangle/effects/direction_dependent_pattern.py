"""A pattern of the angle whose sign is the direction of travel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ArgumentError
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.travel import DirectionalPatternTerm
from .ambiguity import Ambiguity
from .backlash import ONE_WAY, Backlash, goes_both_ways
from .drawing import Drawing
from .effect import Effect, Reported
from .latency import Latency
from .presliding_hysteresis import PreslidingHysteresis
from .search import Array, Fitted, line_parameters, line_quantities
from .shapes import best_shape

#: Orders that play has where a gear is eccentric or worn on one side: half of the prior
#: probability.
LIKELY = 3

#: Lines at most.
MOST_LINES = 6


@dataclass(frozen=True)
class DirectionalPattern(Effect):
    """Forward and backward curves of different shape.

    ::

        ε = d Σ_m C_m sin(mθ + φ_m)

    with the direction of travel d. Its mean over the turn is `Backlash`, a separate cause.

    Parameters
    ----------
    orders, amplitudes_arcsec, phases_deg : list of float
        Output orders m, half of forward minus backward, and phases.
    """

    orders: tuple[float, ...]
    amplitudes_arcsec: tuple[float, ...]
    phases_deg: tuple[float, ...]

    kind: ClassVar[str] = DirectionalPatternTerm.kind
    size_name: ClassVar[str] = "amplitudes_arcsec"
    sentence: ClassVar[str] = (
        "Play or friction differs from place to place (an eccentric or worn gear): the curves "
        "forward and backward have different shapes."
    )
    factor: ClassVar[str] = "direction"
    form_of: ClassVar[tuple[str, ...]] = ("direction_place",)
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Backlash: "both directions over the whole turn",
        Latency: "two speeds at least a factor of 3 apart: play does not grow with speed",
        PreslidingHysteresis: "reversals at several places, and both directions over whole turns",
    }
    of_motion: ClassVar[bool] = True
    measure: ClassVar[str] = "pass every position in both directions, within each run"
    located: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not len(self.orders) == len(self.amplitudes_arcsec) == len(self.phases_deg):
            raise ArgumentError("orders, amplitudes_arcsec and phases_deg must be equally long")

    @property
    def lines(self) -> tuple[tuple[float, float, float], ...]:
        """``(order, arcsec, phase_deg)`` of every line."""
        return tuple(zip(self.orders, self.amplitudes_arcsec, self.phases_deg, strict=True))

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return np.asarray(signals.direction * line_sum(signals.theta, self.lines))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        order = float(of.whole(1, 5))
        return cls((order,), (size,), (of.phase(),))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        signals = regression.signals
        present = [t.shape["order"] for t in regression.terms if t.cause == cls.kind]
        if not goes_both_ways(signals) or len(present) >= MOST_LINES:
            return None
        orders = regression.lines.orders[regression.lines.plausible]
        # Travel (turns) over less than which only low orders are separated.
        if float(signals.run_turns().max()) < 0.5:
            orders = orders[orders <= LIKELY]
        shapes = [{"order": float(m)} for m in orders if m not in present]
        counts = [LIKELY if shape["order"] <= LIKELY else len(shapes) for shape in shapes]
        log_grids = [float(np.log(2.0 * count)) for count in counts]
        return best_shape(cls, regression, shapes, log_grids)

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        return signals.direction[:, None] * line_columns(signals.theta, shape["order"])

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        rows = [(t.shape["order"], *line_parameters(c, v)) for t, c, v in terms]
        orders, amplitudes, phases, *_ = zip(*rows, strict=True)
        return line_quantities(rows), [DirectionalPattern(orders, amplitudes, phases)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        if not goes_both_ways(regression.signals):
            yield cls.blind(ONE_WAY)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (DirectionalPatternTerm(**line_values(self.lines, period)),)
