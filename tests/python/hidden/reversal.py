"""Reversal errors: a dead band, and presliding by Maxwell-slip elements or Bouc-Wen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class Backlash(Source):
    """A gap crossed within a small travel of the output: +size forwards, -size backwards."""

    cause: ClassVar[str] = "backlash"
    crossing: float = 0.01  # degrees of output travel

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        _, direction, travel = scene.motion.since_reversal(scene.time)
        return self.size * direction * np.clip(2.0 * travel / self.crossing - 1.0, -1.0, 1.0)

    def parameters(self) -> dict[str, float]:
        return {"half_width_arcsec": self.size}


@dataclass(frozen=True, kw_only=True)
class MaxwellSlip(Source):
    """Springs in parallel that slip one after the other: piecewise linear, with memory."""

    cause: ClassVar[str] = "presliding_hysteresis"
    slips: tuple[float, ...]  # degrees from rest at which an element slips
    shares: tuple[float, ...]  # of the whole amplitude

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        stretch, direction, travel = scene.motion.since_reversal(scene.time)
        total = np.zeros(scene.theta.size)
        for slip, share in zip(self.slips, self.shares, strict=True):
            state, begin = 0.0, []
            for sign, length in scene.motion.stretches:
                begin.append(state)
                state = float(np.clip(state + sign * length / slip, -1.0, 1.0))
            total += share * np.clip(np.array(begin)[stretch] + direction * travel / slip, -1, 1)
        return self.size * total

    def parameters(self) -> dict[str, float]:
        return {"amplitude_arcsec": self.size}


@dataclass(frozen=True, kw_only=True)
class BoucWen(Source):
    """dz = (1/length) (d - beta |z|^(n-1) z - (1 - beta) d |z|^n) ds, saturating at 1."""

    cause: ClassVar[str] = "presliding_hysteresis"
    length: float
    sharpness: float
    beta: float

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        stretch, _, travel = scene.motion.since_reversal(scene.time)
        grid = np.linspace(0.0, 15.0, 600)  # in lengths: saturated beyond
        state, total = 0.0, np.zeros(scene.theta.size)
        for number, (sign, whole) in enumerate(scene.motion.stretches):
            path = self._path(state, sign, grid)
            here = stretch == number
            total[here] = np.interp(travel[here] / self.length, grid, path)
            state = float(np.interp(whole / self.length, grid, path))
        return self.size * total

    def _path(self, state: float, sign: float, grid: Array) -> Array:
        n, step = self.sharpness, float(grid[1])

        def slope(z: float) -> float:
            size = abs(z)
            return sign - self.beta * size ** (n - 1.0) * z - (1.0 - self.beta) * sign * size**n

        path = np.empty(grid.size)
        for i in range(grid.size):
            path[i] = state
            half = state + 0.5 * step * slope(state)
            state = state + step * slope(half)
        return path

    def parameters(self) -> dict[str, float]:
        return {"amplitude_arcsec": self.size}


def draw_backlash(rng: np.random.Generator) -> Source:
    return Backlash(crossing=float(rng.uniform(0.001, 0.02)))


def draw_presliding(rng: np.random.Generator) -> Source:
    length = float(rng.uniform(2.0, 8.0))
    if rng.integers(2):
        slips = length * np.geomspace(0.15, 1.0, 5) * rng.uniform(0.85, 1.15, 5)
        shares = rng.dirichlet(np.full(5, 4.0))
        return MaxwellSlip(slips=tuple(slips), shares=tuple(shares))
    return BoucWen(
        length=length, sharpness=float(rng.uniform(1.2, 2.0)), beta=float(rng.uniform(0.5, 0.9))
    )
