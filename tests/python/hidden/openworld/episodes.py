"""Levels, relaxations and events that nobody asked for, each bound to time in its own way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..designs import Scene
from ..joint import Joint
from ..source import Array
from .timebound import Shape, TimeBound, _levels, _since_turn


@dataclass(frozen=True, kw_only=True)
class Episode(TimeBound):
    """An effect of this file's table."""

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return self.size * np.asarray(EPISODES[self.kind][0](self, joint, scene, run))


def three_seats(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A part that rests in one of three notches."""
    return s.chance(run).integers(-1, 2, 99)[_levels(s.chance(run + 900), scene.time, 5.0)] * 1.0


def latch(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Off by one amount for a while in the middle of each run, then back."""
    start, length = s.chance(run).uniform(0.1, 0.5), s.chance(run + 1).uniform(0.15, 0.4)
    share = (scene.time - scene.time[0]) / np.ptp(scene.time)
    return ((share > start) & (share < start + length)) * 2.0


def short_seats(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A contact that opens for a dozen readings, a few times in each run."""
    found = np.zeros(scene.time.size)
    for start in s.chance(run).integers(0, scene.time.size - 20, 4):
        found[start : start + 14] = 3.0
    return found


def alike_after_turns(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """An oil film that gives way after each stop, the same in either direction, in two steps."""
    since, _ = _since_turn(scene)
    slow = 1.0 + 2.0 * s.numbers[0]
    return 2.0 * np.exp(-since / slow) + np.exp(-since / (0.2 * slow))


def ringing(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A mass on a spring that rings after each reversal."""
    since, direction = _since_turn(scene)
    beat = np.cos(2.0 * np.pi * (0.3 + 0.4 * s.numbers[0]) * since)
    return 2.0 * direction * np.exp(-since / 2.0) * beat


def dead_time(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A brake that lets go some time after each reversal, however far the joint has come."""
    since, direction = _since_turn(scene)
    return 2.0 * direction * (since < 0.8 + s.numbers[0])


def settling(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Electronics that warm up from the start of each run, alike in all."""
    since = scene.time - scene.time[0]
    return 3.0 * np.exp(-since / (3.0 + 4.0 * s.numbers[0]))


def growing_line(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """Order 5 that grows from nothing to its whole size in the course of each run."""
    share = (scene.time - scene.time[0]) / np.ptp(scene.time)
    return 2.0 * share * np.sin(np.radians(5.0 * scene.theta) + 6.28 * s.numbers[0])


def late_load(s: TimeBound, joint: Joint, scene: Scene, run: int) -> Array:
    """A seat that follows the side of the load some seconds late."""
    side, constant = np.sign(scene.torque), 0.6 + s.numbers[0]
    found, state = np.empty(side.size), float(side[0])
    steps = np.diff(scene.time, prepend=scene.time[0])
    for i, (x, step) in enumerate(zip(side.tolist(), steps.tolist(), strict=True)):
        state += (x - state) * (1.0 - np.exp(-step / constant))
        found[i] = state
    return found


#: Shape and the names that are right for it beside `unexplained`.
EPISODES: dict[str, tuple[Shape, frozenset[str]]] = {
    "three_seats": (three_seats, frozenset()),
    "latch": (latch, frozenset()),
    "short_seats": (short_seats, frozenset()),
    "alike_after_turns": (alike_after_turns, frozenset()),
    "ringing": (ringing, frozenset()),
    "dead_time": (dead_time, frozenset()),
    "settling": (settling, frozenset({"drift_within_run"})),
    "growing_line": (growing_line, frozenset({"varying_line", "missing_order"})),
    "late_load": (
        late_load,
        frozenset({"stiffening_compliance", "torsional_compliance", "torque_hysteresis"}),
    ),
}


def episode(kind: str, rng: np.random.Generator) -> Episode:
    """A random effect of a kind."""
    return Episode(kind=kind, numbers=(float(rng.uniform()),), seed=int(rng.integers(2**31)))
