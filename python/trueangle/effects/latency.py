"""Pure delay: the reading is older than the reference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.earlier import earlier_signals
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.motion import LatencyTerm
from ..support.angles import ARCSEC_PER_DEG
from .ambiguity import OWN_OF_VELOCITY, OWN_POWER, Ambiguity, share_left
from .backlash import Backlash
from .effect import Effect
from .search import Array

TWO_SPEEDS = (
    "move in both directions at two speeds at least a factor of 3 apart, or read at rest as well"
)
UNTIMED = "no time stamps and no velocity were recorded"


@dataclass(frozen=True)
class Latency(Effect):
    """Pure delay: the reading is that of a time tau earlier.

    ::

        ε = -vτ + p(θ - vτ) - p(θ)

    Parameters
    ----------
    delay_s : float
        tau, seconds.
    """

    delay_s: float

    kind: ClassVar[str] = LatencyTerm.kind
    sentence: ClassVar[str] = (
        "One of the two readings is older: the joint's (positive delay) or the "
        "reference's (negative). The error is proportional to velocity, and "
        "the pattern is shifted."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    form_of: ClassVar[tuple[str, ...]] = ("speed", "speed_place")
    measure: ClassVar[str] = (
        "record moving, time-stamped, in both directions at two speeds a factor of 3 apart"
    )
    confused_with: ClassVar[Mapping[type[Effect], str]] = {Backlash: TWO_SPEEDS}
    acts_on_runs: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        then = earlier_signals(signals, self.delay_s).theta
        pattern = around.pattern
        ramp = np.degrees(then - signals.theta) * ARCSEC_PER_DEG
        return np.asarray(ramp + pattern.value(then) - pattern.value(signals.theta))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.signals.velocity is None or regression.has(cls.kind):
            return None
        columns = regression.of_pattern(
            cls.kind, None, lambda: cls.columns(regression.signals, regression.around, {})
        )
        return regression.propose(cls.kind, {}, columns)

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        """Column whose coefficient is tau, arcsec per second, to first order in tau."""
        speed = signals.turns_per_s * (360.0 * ARCSEC_PER_DEG)
        return np.asarray(
            -(speed * (1.0 + around.pattern.value_and_slope(signals.theta)[1]))[:, None]
        )

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.velocity is None:
            yield cls.blind(UNTIMED)
            return
        velocity, way = signals.velocity[:, None], signals.direction[:, None]
        if share_left(regression, velocity) < OWN_POWER:
            yield cls.blind("one speed in one direction (or at rest): a delay is part of the zero")
        elif np.ptp(way) > 0.0 and share_left(regression, velocity, way) < OWN_OF_VELOCITY:
            because = "one speed: a delay and play give the same readings"
            yield cls.blind(because, Backlash, first=False)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (LatencyTerm(self.delay_s),)
