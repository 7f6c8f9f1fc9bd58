"""Readings for goodness of fit: designs of runs, kinds of noise, structure without a name.

Nothing of the library is used but the record that the tests take.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trueangle.diagnosis.goodness import Leftover

Array = NDArray[np.float64]

#: name: runs, readings per run, how the joint moves, speeds in deg/s.
DESIGNS = {
    "rich": (24, 300, "reversing", (5.0, 30.0)),
    "few": (3, 300, "reversing", (10.0,)),
    "one": (1, 1200, "reversing", (10.0,)),
    "forward": (1, 900, "forward", (10.0,)),
    "split": (12, 300, "split", (10.0, 40.0)),
    "grid": (10, 180, "grid", (10.0,)),
    "part": (8, 240, "part", (8.0, 20.0)),
    "small": (6, 60, "forward", (10.0,)),
}

NOISES = ("gauss", "t5", "uniform", "ar 0.5", "ar 0.9", "wander")


@dataclass(frozen=True)
class Motion:
    theta: Array
    direction: Array
    run: NDArray[np.int64]
    clock: Array
    speed: Array
    temperature: Array


def motion(design: str, rng: np.random.Generator) -> Motion:
    runs, count, kind, speeds = DESIGNS[design]
    parts: list[list[Array]] = [[], [], [], [], []]
    for j in range(runs):
        if kind == "reversing":
            lengths = rng.permutation([380.0, 90.0, 20.0, 250.0, 60.0]) * rng.uniform(0.95, 1.1, 5)
            signs = np.resize([1.0, -1.0], 5) * rng.choice([-1.0, 1.0])
            ends = np.concatenate([[0.0], np.cumsum(lengths)])
            way = np.sort(rng.uniform(0.0, ends[-1], count))
            angle = np.interp(way, ends, np.concatenate([[0.0], np.cumsum(lengths * signs)]))
            direction = signs[np.clip(np.searchsorted(ends, way) - 1, 0, 4)]
            angle += rng.uniform(0.0, 360.0)
        elif kind == "part":
            way = np.sort(rng.uniform(0.0, 240.0, count))
            angle, direction = np.minimum(way, 240.0 - way), np.where(way < 120.0, 1.0, -1.0)
        else:
            sign = -1.0 if kind != "forward" and j % 2 else 1.0
            even = np.arange(count) * 360.0 / count
            way = even if kind == "grid" else np.sort(rng.uniform(0.0, 370.0, count))
            angle, direction = sign * way, np.full(count, sign)
            if kind != "grid":
                angle = angle + rng.uniform(0.0, 360.0)
        speed = speeds[j % len(speeds)]
        values = (np.radians(angle), direction, way / speed, np.full(count, speed))
        for part, value in zip(parts, values, strict=False):
            part.append(value)
        parts[4].append(np.full(count, rng.choice([20.0, 35.0])))
    theta, direction, clock, velocity, temperature = (np.concatenate(p) for p in parts)
    run = np.repeat(np.arange(runs), count)
    return Motion(theta, direction, run, clock, velocity, temperature)


def noise(kind: str, clock: Array, rng: np.random.Generator) -> Array:
    n = clock.size
    if kind == "gauss":
        return rng.normal(size=n)
    if kind == "t5":
        return rng.standard_t(5, n) / np.sqrt(5.0 / 3.0)
    if kind == "uniform":
        return rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), n)
    if kind == "wander":  # 1/f in power, up to forty half periods of the run, over white
        k = np.arange(1, 40)
        u = (clock - clock[0]) / (clock[-1] - clock[0])
        slow = (np.cos(np.pi * np.outer(u, k)) * rng.normal(size=39) / np.sqrt(k)).sum(axis=1)
        return np.asarray(rng.normal(size=n) + slow)
    rho, white = float(kind.split()[1]), rng.normal(size=n)
    out = white.copy()
    for i in range(1, n):
        out[i] = rho * out[i - 1] + np.sqrt(1.0 - rho**2) * white[i]
    return out


Structure = Callable[[Motion, np.random.Generator], Array]


def leftover(
    design: str, kind: str, seed: int, structure: Structure | None = None, size: float = 0.0
) -> Leftover:
    """What a fit of five lines leaves of noise, and of ``structure`` of rms ``size``."""
    rng = np.random.default_rng([seed, *map(ord, design + kind)])
    m = motion(design, rng)
    e = np.concatenate([noise(kind, m.clock[m.run == j], rng) for j in range(int(m.run.max()) + 1)])
    if structure is not None:
        hidden = structure(m, rng)
        e = e + size * hidden / float(np.std(hidden))
    angles = np.outer(m.theta, [1, 2, 3, 100, 101])
    lines = np.column_stack([np.ones(e.size), np.cos(angles), np.sin(angles)])
    e = e - lines @ np.linalg.lstsq(lines, e, rcond=None)[0]
    factors = {"speed": m.speed, "temperature": m.temperature}
    return Leftover(e, m.theta, m.direction, m.run, m.clock, True, factors)
