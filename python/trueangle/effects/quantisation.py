"""A lattice of readings coarse enough to be the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..estimation.rounded import is_rounding_visible
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.angles import ARCSEC_PER_DEG
from .effect import Effect, ScatterFinding
from .heteroscedastic_noise import HeteroscedasticNoise
from .search import Array


@dataclass(frozen=True)
class Quantisation(Effect):
    """The reading, its noise included, is rounded to whole steps: ``q/√12``.

    Parameters
    ----------
    step_arcsec : float
        q.
    """

    step_arcsec: float

    kind: ClassVar[str] = "quantisation"
    sentence: ClassVar[str] = (
        "The reading is quantised: the residual is uniform rounding error, constant at rest."
    )
    factor: ClassVar[str] = "none"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        HeteroscedasticNoise: "several readings at rest at each place: rounding does not scatter",
    }
    measure: ClassVar[str] = "readings with the full resolution of the sensor"
    transfers: ClassVar[bool] = False
    rounds: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "rounded digits are lost; use more bits, or average readings"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        # Rounding follows the noise (`written`): with enough of it its mean is zero.
        return np.zeros(len(signals))

    def written(self, degrees: Array) -> Array:
        step = self.step_arcsec / ARCSEC_PER_DEG
        return np.asarray(np.round(degrees / step) * step)

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        step = regression.signals.count
        variance, rounding = regression.variance, step**2 / 12.0
        if regression.is_explained or not is_rounding_visible(rounding, variance, variance):
            return None
        # Of n readings each falls on the lattice by a probability of its tolerance.
        gain = 2.0 * regression.n * float(np.log(10.0)) - regression.log_n
        parameters = {
            "step_arcsec": quantity(step, 0.0),
            "share_of_noise": quantity(min(rounding / variance, 1.0)),
        }
        weights = np.ones(regression.n)
        return ScatterFinding(cls.kind, gain, parameters, [Quantisation(step)], weights)
