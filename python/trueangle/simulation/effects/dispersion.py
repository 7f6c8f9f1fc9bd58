"""Effects on the scatter: wild readings and noise that is not the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings

__all__ = ["HeteroscedasticNoise", "Outliers"]


@dataclass(frozen=True)
class Outliers(Effect):
    """Isolated wild readings: a share of the readings gets a normal error of its own.

    Parameters
    ----------
    fraction : float
        Share of the readings.
    size_arcsec : float
        Standard deviation of their error.
    """

    fraction: float
    size_arcsec: float

    kind: ClassVar[str] = "outliers"
    sentence: ClassVar[str] = (
        "Single readings are wild (bit flips, glitches, mistaken entries) and their neighbours "
        "are not."
    )
    factor: ClassVar[str] = "none"
    confounded_with: ClassVar[dict[str, str]] = {
        "heteroscedastic_noise": "more readings",
        "local_defect": "a second pass over the same place",
    }
    measure: ClassVar[str] = "more readings, each taken twice"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        wild = rng.random(len(signals)) < self.fraction
        return np.asarray(wild * self.size_arcsec * rng.standard_normal(len(signals)))


@dataclass(frozen=True)
class HeteroscedasticNoise(Effect):
    r"""Noise that depends on angle, speed or load.

    .. math:: \ln\sigma^2 = a + b\cos k\theta + c\sin k\theta + e\,|v| + f\,|\tau|

    Parameters
    ----------
    cosine, sine : float
        b and c.
    order : float
        k, output order.
    per_deg_s : float
        e.
    per_Nm : float
        f.
    """

    cosine: float = 0.0
    sine: float = 0.0
    order: float = 1.0
    per_deg_s: float = 0.0
    per_Nm: float = 0.0

    kind: ClassVar[str] = "heteroscedastic_noise"
    sentence: ClassVar[str] = (
        "Readings scatter more at some angles, speeds or loads (friction zones, weak field, "
        "edge of the autocollimator's range)."
    )
    factor: ClassVar[str] = "none"
    confounded_with: ClassVar[dict[str, str]] = {"outliers": "more readings"}
    measure: ClassVar[str] = "at least 1000 readings spread over the angles, speeds and loads"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        return np.zeros(len(signals))

    def noise_factor(self, signals: Signals, around: Surroundings) -> Array | None:
        log_variance = self.cosine * np.cos(self.order * signals.theta)
        log_variance += self.sine * np.sin(self.order * signals.theta)
        log_variance += self.per_deg_s * np.abs(signals.turns_per_s * 360.0)
        if signals.torque is not None:
            log_variance += self.per_Nm * np.abs(signals.torque)
        return np.asarray(np.exp(0.5 * log_variance))
