"""A ramp in angle: a wrong ratio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ArgumentError
from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import ARCSEC_PER_RAD, JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.place import ScaleErrorTerm
from .effect import Effect, Reported
from .search import Array, Fitted


@dataclass(frozen=True)
class ScaleError(Effect):
    """Ramp in angle: ``ε = s θ`` with the unwrapped angle.

    Parameters
    ----------
    relative_error : float
        s, such as 1e-5 for a ratio of 100.001 taken as 100.
    start_deg, stop_deg : float, optional
        Travel over which it was measured: what a correction needs to know.
    """

    relative_error: float
    start_deg: float | None = None
    stop_deg: float | None = None

    kind: ClassVar[str] = ScaleErrorTerm.kind
    sentence: ClassVar[str] = (
        "The ratio or the count of the scale is not what the reading is computed with: the "
        "error grows in proportion to the angle turned."
    )
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    measure: ClassVar[str] = "turn several turns in both directions"
    acts_on_runs: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return self.relative_error * ARCSEC_PER_RAD * signals.theta

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        # Of one run the zero is free, and both are the same.
        origins = ("zero", "start") if regression.signals.runs > 1 else ("zero",)
        extensions = [
            regression.propose(
                cls.kind,
                {"from": origin},
                cls.columns(regression.signals, regression.around, {"from": origin}),
                log_grid=float(np.log(len(origins))),
            )
            for origin in origins
        ]
        return max(extensions, key=lambda p: p.bic_gain)

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        angle = signals.theta
        if shape["from"] == "start":
            angle = angle.copy()
            for start, stop in signals.run_bounds():
                angle[start:stop] -= angle[start]
        return (ARCSEC_PER_RAD * angle)[:, None]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        _, (scale,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        travel = np.degrees(regression.signals.theta)
        found = ScaleError(float(scale), float(travel.min()), float(travel.max()))
        return {"relative_error": quantity(scale, std)}, [found]

    def over(self, start_deg: float, stop_deg: float) -> Self:
        if self.start_deg is not None and self.stop_deg is not None:
            return self
        return replace(self, start_deg=start_deg, stop_deg=stop_deg)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        if self.start_deg is None or self.stop_deg is None:
            raise ArgumentError(
                f"effect '{self.kind}' is corrected over a stated travel only: give start_deg and "
                "stop_deg, or put the ratio right that turns counts into angles"
            )
        degree = period / 360.0
        return (
            ScaleErrorTerm(self.relative_error, self.start_deg * degree, self.stop_deg * degree),
        )
