"""Slow effects: temperature, a new zero in every run, wander within a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .designs import Scene
from .joint import Joint
from .source import Array, Source

#: Temperature at which the simulation holds, degrees Celsius.
REFERENCE_TEMPERATURE = 20.0


@dataclass(frozen=True, kw_only=True)
class ThermalZero(Source):
    """An expanding mount: the zero follows temperature, slightly bent."""

    cause: ClassVar[str] = "thermal_drift"
    bend: float  # per kelvin

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        rise = scene.temperature - REFERENCE_TEMPERATURE
        return self.size * rise * (1.0 + self.bend * rise)


@dataclass(frozen=True, kw_only=True)
class ThermalLines(Source):
    """A field that fades with temperature: offset and gain faults of the encoder grow."""

    cause: ClassVar[str] = "thermal_drift"
    weights: tuple[float, float]
    phases: tuple[float, float]  # degrees
    fade: float = 0.01  # per kelvin

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        rise = scene.temperature - REFERENCE_TEMPERATURE
        growth = 1.0 / (1.0 - self.fade * rise) - 1.0
        lines = sum(
            weight * np.sin(np.radians(k * joint.gear_ratio * scene.theta + phase))
            for k, weight, phase in zip((1, 2), self.weights, self.phases, strict=True)
        )
        return np.asarray(self.size * growth * lines)


@dataclass(frozen=True, kw_only=True)
class ZeroSlip(Source):
    """A coupling that is seated anew before every run: flat or Laplace-distributed zeros."""

    cause: ClassVar[str] = "zero_slip"
    flat: bool

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        chance = self.chance(run)
        zero = chance.uniform(-1.73, 1.73) if self.flat else chance.laplace(scale=0.71)
        return np.full(scene.theta.size, self.size * zero)


@dataclass(frozen=True, kw_only=True)
class Wander(Source):
    """Drift in time, new in every run: a random walk, 1/f noise, or settling."""

    cause: ClassVar[str] = "drift_within_run"
    kind: str  # "walk", "flicker", "settling"

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        chance, time = self.chance(run), scene.time - scene.time[0]
        if self.kind == "walk":
            steps = np.sqrt(np.diff(time, prepend=time[0])) * chance.normal(size=time.size)
            return np.asarray(self.size * np.cumsum(steps))
        if self.kind == "flicker":
            cycles = np.geomspace(0.3, 15.0, 24)[:, None] / time[-1]
            turn = chance.uniform(0.0, 2.0 * np.pi, cycles.shape)
            waves = np.sin(2.0 * np.pi * cycles * time + turn) - np.sin(turn)
            return np.asarray(self.size * (waves / np.sqrt(cycles * time[-1])).sum(axis=0))
        settling = time[-1] * chance.uniform(0.2, 1.5)
        return np.asarray(self.size * chance.normal() * (1.0 - np.exp(-time / settling)))


def draw_thermal(rng: np.random.Generator) -> Source:
    if rng.integers(2):
        return ThermalZero(bend=float(rng.uniform(-0.005, 0.005)))
    share = float(rng.uniform(0.3, 1.0))
    first, second = rng.uniform(0.0, 360.0, 2)
    return ThermalLines(weights=(share, 1.0 - share), phases=(float(first), float(second)))


def draw_zero_slip(rng: np.random.Generator) -> Source:
    return ZeroSlip(flat=bool(rng.integers(2)), seed=int(rng.integers(2**31)))


def draw_wander(rng: np.random.Generator) -> Source:
    kind = str(rng.choice(["walk", "flicker", "settling"]))
    return Wander(kind=kind, seed=int(rng.integers(2**31)))
