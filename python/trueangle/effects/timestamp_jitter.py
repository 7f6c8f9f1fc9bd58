"""Time stamps that scatter: noise in proportion to speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..estimation.linear import NormalEquations
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.angles import ARCSEC_PER_DEG
from .effect import Effect, ScatterFinding
from .heteroscedastic_noise import HeteroscedasticNoise
from .scatter import CLIPPED_VARIANCE, NEW_SCATTER, clipped_squares, standardised_residuals
from .search import Array

#: Scoring steps, and the least variance in robust ones of the whole.
STEPS = 25
FLOOR = 1e-4


@dataclass(frozen=True)
class TimestampJitter(Effect):
    """The moment of a reading scatters: noise of ``|v| σ_t`` beside its own.

    Parameters
    ----------
    sigma_s : float
        ``σ_t``, seconds.
    """

    sigma_s: float

    kind: ClassVar[str] = "timestamp_jitter"
    sentence: ClassVar[str] = (
        "The two readings are not taken at one moment but at moments that scatter: noise in "
        "proportion to speed, none at rest."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "none"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        HeteroscedasticNoise: "three speeds, from rest to the fastest",
    }
    measure: ClassVar[str] = "at least 1000 readings over three speeds, one of them rest"
    transfers: ClassVar[bool] = False
    weighs: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "scatter has no value to subtract: trigger both at once"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        speed = ARCSEC_PER_DEG * 360.0 * signals.turns_per_s
        return np.asarray(speed * self.sigma_s * rng.standard_normal(len(signals)))

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """The square of the speed must tell the noise better than the speed itself does."""
        velocity = regression.signals.velocity
        if regression.is_explained or velocity is None or np.ptp(np.abs(velocity)) == 0.0:
            return None
        e = standardised_residuals(regression)
        plain = _likelihood(e, np.ones((regression.n, 1)), False)[0]
        speed = np.abs(velocity) / np.abs(velocity).max()
        with_speed = np.column_stack([np.ones(regression.n), speed])
        growing = _likelihood(e, with_speed, True)[0]
        value, (own, per_speed) = _likelihood(e, with_speed**2, False)
        penalty = regression.log_n + 2.0 * float(np.log(4.0))
        found = 2.0 * (value - plain) - penalty
        if min(found, 2.0 * (value - growing)) < NEW_SCATTER or own <= 0.0 or per_speed <= 0.0:
            return None
        # Residuals are in robust standard deviations.
        unit = float(np.median(np.abs(_whitened(regression)))) * 1.4826
        top = ARCSEC_PER_DEG * float(np.abs(velocity).max())
        sigma = float(np.sqrt(per_speed)) * unit / top
        variance = own + per_speed * speed**2
        # Jointly with the noise of its own that the readings have.
        slopes = np.column_stack([np.ones(regression.n), speed**2]) / variance[:, None]
        spread = CLIPPED_VARIANCE * np.linalg.inv(slopes.T @ slopes)
        relative = 0.5 * float(np.sqrt(spread[1, 1])) / float(per_speed)
        weights = 1.0 / variance
        return ScatterFinding(
            cls.kind,
            found,
            {"sigma_s": quantity(sigma, sigma * relative)},
            [TimestampJitter(sigma)],
            np.asarray(weights / weights.mean()),
        )


def _whitened(regression: Regression) -> Array:
    left = regression.residual - regression.design @ regression.coefficients
    return np.asarray(regression.whiten(left))


def _likelihood(e: Array, design: Array, logarithm: bool) -> tuple[float, Array]:
    """Normal log-likelihood of noise whose variance (or its logarithm) is ``design @ g``; g.

    Fisher scoring; squares are clipped by their own variance.
    """
    square = e**2
    g = np.zeros(design.shape[1])
    g[0] = 0.0 if logarithm else 1.0
    for _ in range(STEPS):
        linear = design @ g
        variance = np.exp(np.clip(linear, -20.0, 20.0)) if logarithm else np.maximum(linear, FLOOR)
        slope = design if logarithm else design / variance[:, None]
        away = clipped_squares(square, variance) - 1.0
        g = g + NormalEquations.of_rows(slope, away).solved().coefficients[:, 0]
    linear = design @ g
    variance = np.exp(np.clip(linear, -20.0, 20.0)) if logarithm else np.maximum(linear, FLOOR)
    return -0.5 * float(np.sum(np.log(variance) + clipped_squares(square, variance))), g
