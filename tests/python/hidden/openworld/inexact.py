"""Effects of the vocabulary whose form is not the textbook's: their parameters must still hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..designs import Scene
from ..faults import draw_dent
from ..joint import Joint
from ..reversal import Backlash, draw_presliding
from ..source import Array, Source
from ..timing import Latency, draw_filter_lag

#: Size of what is not of the textbook's form, in shares of the effect.
MISFIT = 0.05


@dataclass(frozen=True, kw_only=True)
class LoopedSpring(Source):
    """A spring whose wind-up trails the load: a play operator in the torque."""

    cause: ClassVar[str] = "torsional_compliance"

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        half = MISFIT * float(np.abs(scene.torque).max())
        state = float(scene.torque[0])
        felt = np.empty_like(scene.torque)
        for i, torque in enumerate(scene.torque.tolist()):
            state = min(max(state, torque - half), torque + half)
            felt[i] = state
        return -self.size * felt

    def parameters(self) -> dict[str, float]:
        return {"arcsec_per_Nm": self.size}


@dataclass(frozen=True, kw_only=True)
class ToothedSpring(Source):
    """A spring whose softness varies from tooth to tooth about its mean."""

    cause: ClassVar[str] = "torsional_compliance"
    phase: float  # radians

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        teeth = np.sin(3.0 * np.radians(scene.theta) + self.phase)
        return -self.size * scene.torque * (1.0 + MISFIT * teeth)

    def parameters(self) -> dict[str, float]:
        return {"arcsec_per_Nm": self.size}


@dataclass(frozen=True, kw_only=True)
class SoftPlay(Backlash):
    """Play that is taken up over a part of a degree."""

    cause: ClassVar[str] = "presliding_hysteresis"

    def parameters(self) -> dict[str, float]:
        return {"amplitude_arcsec": self.size}


@dataclass(frozen=True, kw_only=True)
class DelayWithInertia(Source):
    """A delay of a reading that is also pulled along by the acceleration of what carries it."""

    cause: ClassVar[str] = "latency"
    pull: float  # seconds: time over which the velocity is averaged

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        exact = Latency(size=self.size).signal(joint, scene, run)
        early, late = (scene.motion.speed(scene.time + x) for x in (-self.pull, self.pull))
        return exact - self.size * 1e-5 * MISFIT * 3600.0 * (late - early)

    def parameters(self) -> dict[str, float]:
        return {"delay_s": 1e-5 * self.size}


def draw(kind: str, rng: np.random.Generator) -> Source:
    """A random effect of a kind."""
    if kind == "looped spring":
        return LoopedSpring()
    if kind == "toothed spring":
        return ToothedSpring(phase=float(rng.uniform(0.0, 6.28)))
    if kind == "soft play":
        return SoftPlay(crossing=float(rng.uniform(0.2, 0.8)))
    if kind == "slips":
        return draw_presliding(rng)
    if kind == "delay with inertia":
        return DelayWithInertia(pull=float(rng.uniform(0.02, 0.1)))
    if kind == "second filter":
        return draw_filter_lag(rng)
    return draw_dent(rng)


#: Every kind, and its size in standard deviations of the noise.
INEXACT = {
    "looped spring": 8.0,
    "toothed spring": 8.0,
    "soft play": 8.0,
    "slips": 8.0,
    "delay with inertia": 8.0,
    "second filter": 8.0,
    "dent": 1.0,
}
