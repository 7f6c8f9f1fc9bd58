"""What a joint goes through while it is measured: ten designs of runs, and the columns logged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Generator: TypeAlias = np.random.Generator

#: Travelled and timed since the last reversal of readings before the first one.
NEVER = 1e6


@dataclass
class Run:
    """What one run went through, a value each reading (deg, s, deg C, N m, A).

    ``since_reversal`` is in deg of travel and ``reversal_age`` in s, both `NEVER` before the first
    reversal; ``travelled`` and ``acceleration`` are set by the designs that have them.
    """

    angle: Array
    direction: Array
    velocity: Array
    time: Array
    since_reversal: Array
    reversal_age: Array
    travelled: Array | None = None
    acceleration: Array | None = None
    temperature: Array | None = None
    torque: Array | None = None
    current: Array | None = None
    mount: float = 0.0

    @property
    def count(self) -> int:
        """Readings of the run."""
        return len(self.angle)

    @property
    def progress(self) -> Array:
        """Time as a share of the run, 0 to 1."""
        return self.time / max(self.time[-1], 1e-9)

    def at(
        self,
        temperature: Array | float = 21.0,
        torque: Array | float = 0.0,
        current: Array | float = 0.0,
        mount: float = 0.0,
    ) -> Run:
        """The run under these conditions."""
        still = np.zeros(self.count)
        self.temperature, self.torque = temperature + still, torque + still
        self.current = current + still
        self.mount = mount
        return self


Design: TypeAlias = Callable[[Generator], list[Run]]


def travel(legs: list[tuple[float, float]], start: float, count: int, rng: Generator) -> Run:
    """Legs (target in deg, speed in deg/s), with readings spread over the whole way."""
    stops = np.array([start] + [target for target, _ in legs])
    speeds = np.array([speed for _, speed in legs])
    steps = np.diff(stops)
    way = np.concatenate([[0], np.cumsum(np.abs(steps))])
    clock = np.concatenate([[0], np.cumsum(np.abs(steps) / speeds)])
    travelled = (np.arange(count) + rng.random(count)) / count * way[-1]
    leg = np.clip(np.searchsorted(way, travelled, side="right") - 1, 0, len(legs) - 1)
    signs = np.sign(steps)
    direction, speed = signs[leg], speeds[leg]
    time = clock[leg] + (travelled - way[leg]) / speed
    since, age = np.full(count, NEVER), np.full(count, NEVER)
    reversal = None
    for j in range(len(legs)):
        if j and signs[j] != signs[j - 1]:
            reversal = j
        if reversal is not None:
            here = leg == j
            since[here] = travelled[here] - way[reversal]
            age[here] = time[here] - clock[reversal]
    angle = stops[leg] + direction * (travelled - way[leg])
    return Run(angle, direction, direction * speed, time, since, age, travelled)


def sine(angle: Array, degrees: float) -> Array:
    """The sine of an angle in deg, advanced by some."""
    return np.sin(np.radians(1.0) * (angle + degrees))


def full9(rng: Generator) -> list[Run]:
    runs = []
    temperatures = rng.permutation(np.linspace(14, 36, 9))
    torques = rng.permutation([-5, 0, 5] * 3)
    currents = rng.permutation(np.linspace(-3, 3, 9))
    for r in range(9):
        speed = (4.3, 13.0, 37.0)[r % 3]
        run = travel([(570, speed), (-20, speed)], 0.0, 170, rng)
        x = run.progress
        runs.append(
            run.at(
                temperatures[r] + 1.5 * x,
                torques[r] + 3.5 * sine(run.angle, 40),
                currents[r] + 0.8 * np.sin(2 * np.pi * 2.3 * x + r),
            )
        )
    return runs


def five130(rng: Generator) -> list[Run]:
    runs = []
    temperatures = rng.permutation([18.0, 24.0, 30.0, 21.0, 34.0])
    torques = rng.permutation([-4.0, 4.0, 0.0, -2.0, 3.0])
    for r in range(5):
        speed = (6.0, 21.0, 12.0, 6.0, 21.0)[r]
        run = travel([(155.0, speed), (25.0, speed), (155.0, speed)], 25.0, 260, rng)
        x = run.progress
        swing = 2.0 * np.cos(np.radians(run.angle)) + 2.0 * np.sin(2 * np.pi * 1.7 * x)
        current = rng.uniform(-2, 2) + 1.2 * np.cos(2 * np.pi * 2.9 * x)
        runs.append(run.at(temperatures[r] + 2 * x, torques[r] + swing, current))
    return runs


def two(rng: Generator) -> list[Run]:
    runs = []
    for r in range(2):
        speed = (8.0, 26.0)[r]
        run = travel([(420, speed), (0, speed)], 0, 430, rng)
        x = run.progress
        torque = 4 * np.sin(np.radians(run.angle) + 1) + 3 * (r - 0.5) * 2
        current = 1.5 * np.sin(2 * np.pi * 3.3 * x)
        runs.append(run.at(29 - 9 * x if r else 20.0 + 9 * x, torque, current))
    return runs


def twobare(rng: Generator) -> list[Run]:
    runs = []
    for r, (start, stop) in enumerate(((0, 385), (390, -10))):
        run = travel([(stop, 10.0)], start, 450, rng)
        runs.append(run.at(20 + 6.0 * r, 3 * sine(run.angle, 0)))
    return runs


def one(rng: Generator) -> list[Run]:
    legs = [(730.0, 6.0), (0.0, 30.0), (500.0, 15.0), (40.0, 45.0), (430.0, 22.0)]
    run = travel(legs, 0, 1300, rng)
    x = run.progress
    torque = 3 * np.sin(np.radians(run.angle) + 0.5) + 3 * np.sin(2 * np.pi * 5.7 * x)
    current = 2 * np.cos(2 * np.pi * 8.3 * x)
    return [run.at(24 + 7 * np.sin(2 * np.pi * 1.4 * x), torque, current)]


def onearc(rng: Generator) -> list[Run]:
    low, high = 200.0, 275.0
    legs = [(high, 5.0), (low, 18.0), (high, 9.0), (low, 5.0), (high, 18.0), (low, 9.0)]
    run = travel(legs, low, 900, rng)
    x = run.progress
    warmth = 22 + 5 * np.sin(2 * np.pi * 1.2 * x + 1)
    return [run.at(warmth, 4 * np.sin(2 * np.pi * 3.1 * x))]


def fivebare(rng: Generator) -> list[Run]:
    runs = []
    for _ in range(5):
        run = travel([(370, 10.0), (-5, 10.0)], rng.uniform(-3, 3), 230, rng)
        runs.append(run.at(20 + 3 * rng.normal(), 3 * sine(run.angle, 0)))
    return runs


def nine210(rng: Generator) -> list[Run]:
    runs = []
    torques = rng.permutation(np.linspace(-5, 5, 9))
    for r in range(9):
        speed = (5.0, 16.0, 33.0)[(r * 2) % 3]
        run = travel([(270.0, speed), (60.0, speed), (270.0, speed)], 60.0, 190, rng)
        runs.append(run.at(20.0, torques[r] + 2.5 * sine(run.angle, 0)))
    return runs


def sine5(rng: Generator) -> list[Run]:
    runs = []
    for hertz in (0.05, 0.12, 0.08, 0.2, 0.05):
        time = np.sort(rng.random(280)) * 4 / hertz
        rate = 2 * np.pi * hertz
        phase = rate * time
        angle, velocity = 180 + 80 * np.sin(phase), 80 * rate * np.cos(phase)
        direction = np.sign(velocity)
        half = phase / np.pi + 0.5
        first = half < 1
        age = np.where(first, NEVER, (half - np.floor(half)) * np.pi / rate)
        since = np.where(first, NEVER, np.where(direction > 0, angle - 100, 260 - angle))
        run = Run(angle, direction, velocity, time, since, age)
        run.acceleration = -80 * rate**2 * np.sin(phase)
        runs.append(run.at())
    return runs


def mount6(rng: Generator) -> list[Run]:
    return [
        travel([(400, 12.0), (-5, 12.0)], 0, 220, rng).at(mount=mount)
        for mount in (0, 130, 250, 0, 130, 250)
    ]


#: Runs of each design, and the columns that its log has.
DESIGNS: dict[str, tuple[Design, frozenset[str]]] = {
    "full9": (full9, frozenset({"time", "velocity", "torque", "temperature", "current"})),
    "nine210": (nine210, frozenset({"time", "velocity", "torque"})),
    "five130": (five130, frozenset({"time", "torque", "temperature", "current"})),
    "fivebare": (fivebare, frozenset()),
    "two": (two, frozenset({"time", "torque", "temperature"})),
    "twobare": (twobare, frozenset()),
    "one": (one, frozenset({"time", "velocity", "torque", "temperature", "current"})),
    "onearc": (onearc, frozenset({"time", "torque", "temperature"})),
    "sine5": (sine5, frozenset({"time", "velocity"})),
    "mount6": (mount6, frozenset({"time", "mount"})),
}
