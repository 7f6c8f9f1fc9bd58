"""Effects of time on the reading: a pure delay, and a tracking filter of second order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class Latency(Source):
    """The reading is that of ``size`` x 10 us ago, on the true path of the motion."""

    cause: ClassVar[str] = "latency"

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        late = scene.motion.angle(scene.time - self._delay)
        moved = (late - scene.theta) * 3600.0
        return moved + joint.pattern(late) - joint.pattern(scene.theta)

    @property
    def _delay(self) -> float:
        return 1e-5 * self.size

    def parameters(self) -> dict[str, float]:
        return {"delay_s": self._delay}


@dataclass(frozen=True, kw_only=True)
class FilterLag(Source):
    """A tracking loop of second order: no ramp error, but the pattern is low-passed."""

    cause: ClassVar[str] = "filter_lag"
    damping: float

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        natural = 150.0 / self.size  # hertz
        frequency = joint.orders * scene.velocity[:, None] / 360.0 / natural
        response = 1.0 / (1.0 - frequency**2 + 2j * self.damping * frequency)
        angle = np.radians(scene.theta)[:, None] * joint.orders + joint.phases
        return np.asarray((np.exp(1j * angle) * (response - 1.0)).imag @ joint.amplitudes)

    def parameters(self) -> dict[str, float]:
        # The first-order filter with the same delay at low frequency.
        return {"cutoff_hz": 150.0 / self.size / (2.0 * self.damping)}


def draw_latency(rng: np.random.Generator) -> Source:
    return Latency()


def draw_filter_lag(rng: np.random.Generator) -> Source:
    return FilterLag(damping=float(rng.uniform(0.6, 1.0)))
