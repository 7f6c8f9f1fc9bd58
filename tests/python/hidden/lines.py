"""Lines the simulation lacks: orders, sidebands, bearings, the ratio, the reference, argument."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .designs import Scene
from .joint import LINES, Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class MissingOrder(Source):
    """One line that the simulation does not list."""

    cause: ClassVar[str] = "missing_order"
    shaft: str
    order: int
    phase: float  # degrees

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        order = self.order * joint.cycles(self.shaft)
        return self.size * np.sin(np.radians(order * scene.theta + self.phase))

    def parameters(self) -> dict[str, float]:
        return {"amplitude_arcsec": self.size}


@dataclass(frozen=True, kw_only=True)
class Modulation(Source):
    """A gear line whose depth or phase varies over the output turn."""

    cause: ClassVar[str] = "sidebands"
    carrier: tuple[str, int]
    step: int
    of_phase: bool
    phases: tuple[float, float]  # degrees, of the modulation and of the modulated line

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        shaft, order = self.carrier
        slow = np.radians(self.step * scene.theta + self.phases[0])
        fast = np.radians(order * joint.cycles(shaft) * scene.theta + self.phases[1])
        if not self.of_phase:
            return self.size * np.cos(slow) * np.sin(fast)
        strong = 30.0  # arcsec: what is modulated
        swing = self.size / strong
        return strong * (np.sin(fast + swing * np.cos(slow)) - np.sin(fast))


@dataclass(frozen=True, kw_only=True)
class Bearing(Source):
    """A cage that slips: a non-integer order, its phase new in every run and not quite still."""

    cause: ClassVar[str] = "non_integer_order"
    share: float  # of the wave generator's cycles
    slip: float = 0.25  # radians of phase wander per turn of travel

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        chance = self.chance(run)
        turns = np.abs(np.diff(scene.theta, prepend=scene.theta[0])) / 360.0
        wander = self.slip * np.cumsum(np.sqrt(turns) * chance.normal(size=turns.size))
        start = chance.uniform(0.0, 2.0 * np.pi)
        return self.size * np.sin(np.radians(self.order(joint) * scene.theta) + start + wander)

    def order(self, joint: Joint) -> float:
        """The non-integer order, at least 0.15 away from an integer."""
        order = self.share * (joint.gear_ratio + 1.0)
        return float(np.floor(order) + np.clip(order % 1.0, 0.15, 0.85))


@dataclass(frozen=True, kw_only=True)
class WrongRatio(Source):
    """The reading is scaled by 1 + size * 1e-6."""

    cause: ClassVar[str] = "scale_error"

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return self.size * 1e-6 * scene.theta * 3600.0

    def parameters(self) -> dict[str, float]:
        return {"relative_error": self.size * 1e-6}


@dataclass(frozen=True, kw_only=True)
class ReferenceEccentricity(Source):
    """The reference's own error, turning with its mount: eccentricity and an order 2."""

    cause: ClassVar[str] = "reference_error"
    of_reference: ClassVar[bool] = True
    phases: tuple[float, float]  # degrees
    second: float  # amplitude of order 2 over that of order 1

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        angle = np.radians(scene.theta + scene.mount + self.phases[0])
        offset = np.radians(self.size / 3600.0)  # eccentricity over radius
        first = np.degrees(np.arctan2(offset * np.sin(angle), 1.0 + offset * np.cos(angle)))
        twice = np.radians(2.0 * (scene.theta + scene.mount) + self.phases[1])
        return -(3600.0 * first + self.size * self.second * np.sin(twice))


@dataclass(frozen=True, kw_only=True)
class IndicatedArgument(Source):
    """The pattern belongs to the indicated angle; the size is that of the whole pattern."""

    cause: ClassVar[str] = "argument_error"
    exponent: ClassVar[float] = 2.0

    def adapt(self, joint: Joint) -> Joint:
        return joint.scaled(self.size)

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        plain = joint.pattern(scene.theta)
        error = plain
        for _ in range(12):  # the slope stays below 0.2: 1e-9 of the error
            error = joint.pattern(scene.theta + (joint.zero + error) / 3600.0)
        return error - plain


def draw_missing_order(rng: np.random.Generator) -> Source:
    known = {(shaft, order) for shaft, order, _, _ in LINES}
    candidates = [("output", k) for k in range(4, 18)]
    candidates += [("motor", k) for k in (5, 6)] * 3
    candidates += [("wave_generator", k) for k in (1, 3, 4)] * 3
    free = [line for line in candidates if line not in known]
    shaft, order = free[int(rng.integers(len(free)))]
    return MissingOrder(shaft=shaft, order=order, phase=float(rng.uniform(0.0, 360.0)))


def draw_sidebands(rng: np.random.Generator) -> Source:
    # Steps of 2 beside the second orders would fall onto each other's carriers.
    carriers = [("motor", 1, 1), ("motor", 1, 2), ("motor", 2, 1), ("wave_generator", 2, 1)]
    shaft, order, step = carriers[int(rng.integers(len(carriers)))]
    slow, fast = rng.uniform(0.0, 360.0, 2)
    return Modulation(
        carrier=(shaft, order),
        step=step,
        of_phase=bool(rng.integers(2)),
        phases=(float(slow), float(fast)),
    )


def draw_bearing(rng: np.random.Generator) -> Source:
    return Bearing(share=float(rng.uniform(0.35, 0.45)), seed=int(rng.integers(2**31)))


def draw_scale(rng: np.random.Generator) -> Source:
    return WrongRatio()


def draw_reference(rng: np.random.Generator) -> Source:
    first, second = rng.uniform(0.0, 360.0, 2)
    return ReferenceEccentricity(
        phases=(float(first), float(second)), second=float(rng.uniform(0.0, 0.7))
    )


def draw_argument(rng: np.random.Generator) -> Source:
    return IndicatedArgument()
