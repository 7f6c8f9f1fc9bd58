"""Time stamps that scatter: noise in proportion to speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.angles import ARCSEC_PER_DEG
from .effect import Effect, ScatterFinding
from .heteroscedastic_noise import HeteroscedasticNoise, speed_penalty
from .noiselaw import NoiseLaw, noise_law, standardised_residuals
from .search import Array


@dataclass(frozen=True)
class TimestampJitter(Effect):
    """The moment of a reading scatters: noise of ``|v| σ_t`` in addition to its own.

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
    not_at_run_time: ClassVar[str] = "scatter has no value to subtract; trigger both at once"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        speed = ARCSEC_PER_DEG * 360.0 * signals.turns_per_s
        return np.asarray(speed * self.sigma_s * rng.standard_normal(len(signals)))

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """Noise whose variance is a constant plus a part proportional to the square of the speed.

        Whether the speed itself describes the noise as well is tested for all causes of the scatter
        together (`trueangle.diagnosis.unevennoise`).
        """
        speed = shares_of_speed(regression)
        if speed is None:
            return None
        square = standardised_residuals(regression) ** 2
        same = np.ones((regression.n, 1))
        law = noise_law(square, same, speed)
        plain = noise_law(square, same).log_likelihood
        gain = 2.0 * (law.log_likelihood - plain) - speed_penalty(regression)
        return cls.finding_of(law, regression, gain) if gain > 0.0 else None

    @classmethod
    def finding_of(cls, law: NoiseLaw, regression: Regression, gain: float = 0.0) -> ScatterFinding:
        """The finding of a law that grows with the square of the speed."""
        assert regression.signals.velocity is not None
        # Residuals are in robust standard deviations.
        e = regression.residual - regression.design @ regression.coefficients
        unit = float(np.median(np.abs(regression.whiten(e)))) * 1.4826
        top = ARCSEC_PER_DEG * float(np.abs(regression.signals.velocity).max())
        sigma = float(np.exp(0.5 * law.log_growth)) * unit / top
        relative = 0.5 * float(np.sqrt(law.covariance[-1, -1]))
        return ScatterFinding(
            cls.kind,
            gain,
            {"sigma_s": quantity(sigma, sigma * relative)},
            [TimestampJitter(sigma)],
            law.weights,
        )


def shares_of_speed(regression: Regression) -> Array | None:
    """Speeds in shares of the largest; None where they do not differ, or nothing scatters."""
    velocity = regression.signals.velocity
    if regression.is_explained or velocity is None or np.ptp(np.abs(velocity)) == 0.0:
        return None
    return np.asarray(np.abs(velocity) / np.abs(velocity).max())
