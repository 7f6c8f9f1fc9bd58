"""Effects bound to time or to events, and runs there and back whose direction nobody logged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from trueangle import CalibrationRun

from ..designs import Scene
from ..joint import Joint
from ..source import Array, Source

Shape = Callable[["TimeBound", Joint, Scene, int], Array]

ARCSEC = 1.0 / 3600.0


@dataclass(frozen=True, kw_only=True)
class TimeBound(Source):
    """An effect given by a function of what happens in time; ``numbers`` are random, in [0, 1)."""

    cause: ClassVar[str] = "none"
    kind: str
    numbers: tuple[float, ...]

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return self.size * np.asarray(FORMS[self.kind][0](self, joint, scene, run))


def _since_turn(scene: Scene) -> tuple[Array, Array]:
    """Seconds since the last reversal (or the start of the run), and the direction."""
    stretch, direction, _ = scene.motion.since_reversal(scene.time)
    first = np.concatenate([[True], np.diff(stretch) != 0])
    start = scene.time[np.flatnonzero(first)][np.cumsum(first) - 1]
    return scene.time - start, direction


def _levels(chance: np.random.Generator, time: Array, steps: float) -> Array:
    """Number of the episode of every reading, about ``steps`` changes in the record."""
    share = (time - time[0]) / (time[-1] - time[0])
    return np.searchsorted(np.sort(chance.uniform(size=chance.poisson(steps) + 1)), share)


def seats(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A magnet that is loose between two seats and changes over at random."""
    chance = s.chance(run)
    return (_levels(chance, scene.time, 4.0) + chance.integers(2)) % 2 - 0.5


def relaxing(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Grease that gives way in time after each reversal, whatever was travelled."""
    since, direction = _since_turn(scene)
    return direction * np.exp(-since / (0.8 + 1.5 * s.numbers[0]))


def gain_steps(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A range that the amplifier switches: a line is there in some episodes only."""
    gain = s.chance(run).uniform(0.0, 1.0, 99)[_levels(s.chance(run), scene.time, 3.0)]
    return gain * np.sin(np.radians(3.0 * scene.theta) + 6.28 * s.numbers[0])


def head_drops_out(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """One of two heads is silent for a while: what they cancelled comes back."""
    away = (_levels(s.chance(run), scene.time, 3.0) + s.chance(run + 500).integers(2)) % 2
    return away * np.sin(np.radians(scene.theta) + 6.28 * s.numbers[0])


def relays(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Minor loops: relays that switch at angles of their own, up at one and down at another."""
    chance = np.random.default_rng(s.seed)
    low = chance.uniform(-60.0, 60.0, 40)
    wide = chance.exponential(12.0, 40)
    start = scene.theta - scene.theta[0]
    state = np.sign(chance.normal(size=40))
    found = np.empty(start.size)
    for i, x in enumerate(start.tolist()):
        state = np.where(x > low + wide, 1.0, np.where(x < low, -1.0, state))
        found[i] = state.mean()
    return found


def torque_play(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Play that lies on the side to which the load presses it."""
    return np.tanh(scene.torque / 0.3)


def creep(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A plastic part that goes on giving way under the load of the run."""
    since = scene.time - scene.time[0]
    return scene.torque[0] * np.log1p(since / (0.5 + 4.0 * s.numbers[0]))


def drag(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """The drag of a fluid."""
    return scene.velocity * np.abs(scene.velocity)


def alias(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Mains in readings taken at nearly a whole part of its period."""
    index = np.arange(scene.time.size)
    return np.sin(2.0 * np.pi * (0.012 + 0.02 * s.numbers[0]) * index + s.chance(run).uniform(0, 6))


#: Shape and the names that are right for it beside `unexplained`.
FORMS: dict[str, tuple[Shape, frozenset[str]]] = {
    "seats": (seats, frozenset()),
    "relaxing": (relaxing, frozenset()),
    "gain_steps": (gain_steps, frozenset({"varying_line", "missing_order"})),
    "head_drops_out": (head_drops_out, frozenset({"varying_line", "missing_order"})),
    "relays": (relays, frozenset({"presliding_hysteresis", "direction_dependent_pattern"})),
    "torque_play": (torque_play, frozenset({"stiffening_compliance", "torsional_compliance"})),
    "creep": (creep, frozenset({"drift_within_run"})),
    "drag": (drag, frozenset()),
    "alias": (alias, frozenset({"time_periodic"})),
}


def timebound(kind: str, rng: np.random.Generator) -> TimeBound:
    """A random effect of a kind."""
    return TimeBound(kind=kind, numbers=(float(rng.uniform()),), seed=int(rng.integers(2**31)))


#: Noise of a reading of the runs there and back, arcsec; readings, and speeds in deg/s.
SIGMA, READINGS, SPEEDS = 2.0, 400, (15.0, 30.0, 60.0)


def correlated(n: int, rho: float, rng: np.random.Generator) -> Array:
    """Noise of deviation 1 of which each reading shares ``rho`` with the next."""
    noise = rng.normal(size=n)
    for i in range(1, n):
        noise[i] = rho * noise[i - 1] + np.sqrt(1.0 - rho**2) * noise[i]
    return noise


def there_and_back(
    joint: Joint, rho: float, play: float, rng: np.random.Generator, acceleration: float = np.inf
) -> list[CalibrationRun]:
    """Nine runs that turn back once, sampled evenly; ``play`` in deviations of the noise."""
    runs = []
    for j in range(9):
        speed = SPEEDS[j % 3]
        span = float(rng.uniform(300.0, 380.0))
        time = (np.arange(READINGS) + rng.uniform()) * 2.0 * span / speed / READINGS
        away = speed * np.abs(time - span / speed)
        if np.isfinite(acceleration):  # about the turning point the speed changes steadily
            ramp = 0.5 * speed**2 / acceleration
            away = np.where(away < 2.0 * ramp, ramp + 0.25 * away**2 / ramp, away)
        theta = span - away + float(rng.uniform(0.0, 360.0))
        direction = np.where(time < span / speed, 1.0, -1.0)
        error = joint.zero + joint.pattern(theta) + play * SIGMA * direction
        error = error + SIGMA * correlated(READINGS, rho, rng)
        indicated = theta + error * ARCSEC
        runs.append(CalibrationRun(theta, indicated, period=360.0, time=time, label=f"run{j}"))
    return runs
