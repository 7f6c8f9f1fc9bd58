"""A ramp in angle: a wrong ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..joint.pattern import ARCSEC_PER_RAD, Surroundings
from ..joint.signals import Signals
from ..regression.estimate import Parameters, quantity
from ..regression.extension import Extension
from ..regression.regression import Regression
from .effect import Effect
from .search import (
    Array,
    Fitted,
)

__all__ = ["ScaleError"]


@dataclass(frozen=True)
class ScaleError(Effect):
    r"""Ramp in angle: :math:`\varepsilon = s\,\theta` with the unwrapped angle.

    Parameters
    ----------
    relative_error : float
        s, such as 1e-5 for a ratio of 100.001 taken as 100.
    """

    relative_error: float

    kind: ClassVar[str] = "scale_error"
    sentence: ClassVar[str] = (
        "The ratio or the count of the scale is not what the reading is computed with: the "
        "error grows in proportion to the angle turned."
    )
    measure: ClassVar[str] = "turn several turns in both directions"
    acts_on_runs: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = (
        "the ratio that turns counts into angles is wrong: put it right there"
    )

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        return self.relative_error * ARCSEC_PER_RAD * signals.theta

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        extensions = [
            regression.propose(
                cls.kind,
                shape,
                cls.columns(regression.signals, regression.around, shape),
                log_grid=float(np.log(2.0)),
            )
            for shape in ({"from": "zero"}, {"from": "start"})
        ]
        return max(extensions, key=lambda p: p.bic_gain)

    @classmethod
    def columns(cls, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        angle = signals.theta
        if shape["from"] == "start":
            angle = angle.copy()
            for start, stop in signals.run_bounds():
                angle[start:stop] -= angle[start]
        return (ARCSEC_PER_RAD * angle)[:, None]

    @classmethod
    def report(
        cls, regression: Regression, terms: Sequence[Fitted]
    ) -> tuple[Parameters, list[Effect]]:
        _, (scale,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"relative_error": quantity(scale, std)}, [ScaleError(float(scale))]
