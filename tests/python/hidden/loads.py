"""Effects of the torque: a linear spring, a three-segment spring, lines that grow with load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from .designs import Scene
from .joint import Joint
from .source import Array, Source

#: Rms left by a linear spring, as a share of a stiffening spring's rms: sqrt(1 - 0.92).
NONLINEAR_SHARE = 0.28


@dataclass(frozen=True, kw_only=True)
class Compliance(Source):
    """The output runs ahead of the motor under torque: the reading lags by size * T."""

    cause: ClassVar[str] = "torsional_compliance"

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return -self.size * scene.torque

    def parameters(self) -> dict[str, float]:
        return {"arcsec_per_Nm": self.size}


@dataclass(frozen=True, kw_only=True)
class StiffeningSpring(Source):
    """The catalogue's spring of three segments: 1/K falls at T1 and again at T2."""

    cause: ClassVar[str] = "stiffening_compliance"
    limits: tuple[float, float]  # Nm
    softness: tuple[float, float]  # 1/K2 and 1/K3, in units of 1/K1

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        torque = np.abs(scene.torque)
        first, second = self.limits
        middle, last = self.softness
        windup = (
            np.minimum(torque, first)
            + middle * np.clip(torque - first, 0.0, second - first)
            + last * np.maximum(torque - second, 0.0)
        )
        return -self.size * np.sign(scene.torque) * windup

    def sized(self, joint: Joint, scenes: Sequence[Scene], rms: float) -> Self:
        """Sized by what a linear spring leaves, 28 % of the rms of the catalogue's example.

        A linear spring explains 92 % of a stiffening one there. Whatever share it explains
        of this one, the part that tells the two apart is as strong as that.
        """
        signal = np.concatenate(self.signals(joint, scenes))
        torque = np.concatenate([scene.torque for scene in scenes])
        rest = signal - torque * (signal @ torque) / (torque @ torque)
        return replace(self, size=self.size * rms * NONLINEAR_SHARE / float(rest.std()))


@dataclass(frozen=True, kw_only=True)
class LoadedLines(Source):
    """Mesh stiffness that varies over the teeth: lines that grow with torque and saturate."""

    cause: ClassVar[str] = "load_dependent_gear_error"
    weights: tuple[float, float]  # of motor order 2 and wave generator order 2
    phases: tuple[float, float]  # degrees
    knee: float = 15.0  # Nm

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        grown = scene.torque / np.sqrt(1.0 + (scene.torque / self.knee) ** 2)
        orders = (2.0 * joint.cycles("motor"), 2.0 * joint.cycles("wave_generator"))
        lines = sum(
            weight * np.sin(np.radians(order * scene.theta + phase))
            for weight, order, phase in zip(self.weights, orders, self.phases, strict=True)
        )
        return np.asarray(self.size * grown * lines)


def draw_compliance(rng: np.random.Generator) -> Source:
    return Compliance()


def draw_stiffening(rng: np.random.Generator) -> Source:
    middle = 1.0 / float(rng.uniform(1.4, 2.0))
    return StiffeningSpring(
        limits=(float(rng.uniform(0.8, 1.8)), float(rng.uniform(2.4, 3.6))),
        softness=(middle, middle / float(rng.uniform(1.2, 1.7))),
    )


def draw_loaded_lines(rng: np.random.Generator) -> Source:
    share = float(rng.uniform(0.3, 1.0))
    first, second = rng.uniform(0.0, 360.0, 2)
    return LoadedLines(weights=(1.0 - share, share), phases=(float(first), float(second)))
