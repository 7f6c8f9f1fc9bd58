"""Faults of single readings and places: outliers, lost counts, uneven noise, a dent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class WildReadings(Source):
    """A fraction of the readings is off by one flipped bit, or by a Student-t number."""

    cause: ClassVar[str] = "outliers"
    flips: bool
    fraction: float = 0.01

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        chance = self.chance(run)
        wild = chance.random(scene.theta.size) < self.fraction
        bits = 2.0 ** chance.integers(0, 5, wild.size) * chance.choice([-1.0, 1.0], wild.size)
        # The variance of t3 is 3; without its tail one reading would carry all of the rms.
        smooth = np.clip(chance.standard_t(3, wild.size), -8.0, 8.0)
        return self.size * wild * (bits if self.flips else smooth)

    def parameters(self) -> dict[str, float]:
        return {"fraction": self.fraction}


@dataclass(frozen=True, kw_only=True)
class LostCounts(Source):
    """In one run a step that stays until its end."""

    cause: ClassVar[str] = "missed_counts"
    place: float  # of the run among all runs, in [0, 1)
    onset: float  # share of the run's readings before the step

    def signals(self, joint: Joint, scenes: Sequence[Scene]) -> list[Array]:
        signals = [np.zeros(scene.theta.size) for scene in scenes]
        run = int(self.place * len(scenes))
        signals[run][int(self.onset * signals[run].size) :] = self.size
        return signals

    def parameters(self) -> dict[str, float]:
        return {"step_arcsec": self.size}


@dataclass(frozen=True, kw_only=True)
class UnevenNoise(Source):
    """Noise that changes by +-35 % with the angle (a triangle or two zones) or with speed."""

    cause: ClassVar[str] = "heteroscedastic_noise"
    kind: str  # "triangle", "zones", "speed"
    phase: float  # degrees

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return np.zeros(scene.theta.size)

    def noise_factors(self, scenes: Sequence[Scene]) -> list[Array]:
        top = max(float(np.abs(scene.velocity).max()) for scene in scenes)
        return [1.0 + 0.35 * self.size * self._shape(scene, top) for scene in scenes]

    def _shape(self, scene: Scene, top: float) -> Array:
        """Between -1 and 1."""
        turn = (scene.theta - self.phase) % 360.0 / 360.0
        if self.kind == "triangle":
            return np.asarray(4.0 * np.abs(turn - 0.5) - 1.0)
        if self.kind == "zones":
            return np.where(turn < 0.4, 1.0, -1.0)
        return np.asarray(2.0 * np.minimum(np.abs(scene.velocity) / top, 1.0) - 1.0)

    def sized(self, joint: Joint, scenes: Sequence[Scene], rms: float) -> UnevenNoise:
        return UnevenNoise(kind=self.kind, phase=self.phase, seed=self.seed, size=rms)


@dataclass(frozen=True, kw_only=True)
class Dent(Source):
    """A bump at one place of a shaft: a triangle or a raised cosine."""

    cause: ClassVar[str] = "local_defect"
    shaft: str
    place: float  # degrees of that shaft
    width: float  # full width at half height, degrees of that shaft
    triangular: bool

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        angle = joint.cycles(self.shaft) * scene.theta - self.place
        away = np.abs((angle + 180.0) % 360.0 - 180.0) / self.width
        inside = away < 1.0
        bump = 1.0 - away if self.triangular else 0.5 + 0.5 * np.cos(np.pi * away)
        return self.size * np.where(inside, bump, 0.0)

    def parameters(self) -> dict[str, float]:
        return {"place_deg": self.place}


def draw_outliers(rng: np.random.Generator) -> Source:
    return WildReadings(flips=bool(rng.integers(2)), seed=int(rng.integers(2**31)))


def draw_lost_counts(rng: np.random.Generator) -> Source:
    return LostCounts(place=float(rng.random()), onset=float(rng.uniform(0.2, 0.8)))


def draw_uneven_noise(rng: np.random.Generator) -> Source:
    # That of the speed two speeds do not tell from stamps that scatter: test_speed_noise.py.
    kind = str(rng.choice(["triangle", "zones"]))
    return UnevenNoise(kind=kind, phase=float(rng.uniform(0.0, 360.0)))


def draw_speed_noise(rng: np.random.Generator) -> Source:
    return UnevenNoise(kind="speed", phase=0.0)


def draw_dent(rng: np.random.Generator) -> Source:
    on_motor = rng.random() < 1.0 / 3.0
    return Dent(
        shaft="motor" if on_motor else "output",
        place=float(rng.uniform(0.0, 360.0)),
        width=float(rng.uniform(12.0, 30.0) if on_motor else rng.uniform(0.8, 2.5)),
        triangular=bool(rng.integers(2)),
    )
