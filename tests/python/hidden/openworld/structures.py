"""Effects that no cause of the vocabulary describes, or only a broader one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..designs import Scene
from ..joint import Joint
from ..source import Array, Source

Shape = Callable[["Structure", Joint, Scene, int], Array]


@dataclass(frozen=True, kw_only=True)
class Structure(Source):
    """An effect given by a function; ``numbers`` are its random parameters."""

    cause: ClassVar[str] = "none"
    kind: str
    numbers: tuple[float, ...]

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        return self.size * np.asarray(SHAPES[self.kind][0](self, joint, scene, run))


def _direction(scene: Scene) -> Array:
    return np.asarray(scene.motion.since_reversal(scene.time)[1])


def two_shapes(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """Forward and reverse curves differ by a smooth bump pattern without a mean."""
    x = np.radians(scene.theta + s.numbers[0])
    return _direction(scene) * (np.exp(np.cos(x - 1.0) * 2.0) - np.exp(np.cos(x + 1.5) * 2.0))


def pick_up(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """50 Hz and a third of it at three times that."""
    w = 2.0 * np.pi * 50.0 * scene.time + s.chance(run).uniform(0.0, 2.0 * np.pi)
    return np.sin(w) + 0.3 * np.sin(3.0 * w + 1.0)


def vibration(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A machine beside it: one frequency, slightly another in every run."""
    f = (0.35 + 0.1 * s.numbers[0] / 360.0) * (1.0 + 0.002 * s.chance(run).normal())
    return np.sin(2.0 * np.pi * f * scene.time + s.chance(run + 1000).uniform(0.0, 2.0 * np.pi))


def speed_line(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A line near no known one whose size follows the speed."""
    order = 1.5 * joint.gear_ratio + 3.0
    return np.abs(scene.velocity) * np.sin(np.radians(order * scene.theta + s.numbers[0]))


def warm_play(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """Play that opens with temperature about its usual width."""
    return _direction(scene) * (scene.temperature - 27.5)


def own_patterns(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A pattern of five low orders that is another one in every run."""
    chance = s.chance(run)
    orders = np.arange(5, 10)
    phases = chance.uniform(0.0, 360.0, 5)
    return np.asarray(
        np.sin(np.radians(np.outer(scene.theta, orders) + phases)) @ chance.normal(size=5)
    )


def sticking(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A saw-tooth in angle, its start new in every run, at low speed only."""
    slow = 1.0 / (1.0 + (scene.velocity / 15.0) ** 2)
    start = s.chance(run).uniform()
    return slow * (np.mod(scene.theta / (7.0 + 4.0 * s.numbers[0] / 360.0) + start, 1.0) - 0.5)


def some_runs(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A line that is there in every other run only."""
    return float(run % 2) * np.sin(np.radians(11.0 * scene.theta + s.numbers[0]))


def load_pattern(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """A saw-tooth pattern of the angle that grows with the size of the load."""
    x = np.mod(3.0 * scene.theta / 360.0 + s.numbers[0] / 360.0, 1.0) - 0.5
    return np.abs(scene.torque) * x


def beat(s: Structure, joint: Joint, scene: Scene, run: int) -> Array:
    """Two lines in time that beat."""
    f = 0.22 + 0.05 * s.numbers[0] / 360.0
    a, b = s.chance(run).uniform(0.0, 2.0 * np.pi, 2)
    t = 2.0 * np.pi * scene.time
    return np.sin(f * t + a) + np.sin(1.31 * f * t + b)


#: Shape and the broader names that are right for it; where nothing is named, `unexplained`.
SHAPES: dict[str, tuple[Shape, frozenset[str]]] = {
    "two_shapes": (two_shapes, frozenset({"direction_dependent_pattern"})),
    "pick_up": (pick_up, frozenset({"time_periodic"})),
    "vibration": (vibration, frozenset({"time_periodic"})),
    "speed_line": (speed_line, frozenset({"varying_line", "missing_order"})),
    "warm_play": (warm_play, frozenset()),
    "own_patterns": (own_patterns, frozenset({"varying_line"})),
    "sticking": (sticking, frozenset({"varying_line"})),
    "some_runs": (some_runs, frozenset({"varying_line", "missing_order"})),
    "load_pattern": (load_pattern, frozenset({"load_dependent_gear_error"})),
    "beat": (beat, frozenset({"time_periodic"})),
}


def structure(kind: str, rng: np.random.Generator) -> Structure:
    """A random effect of a kind."""
    return Structure(
        kind=kind, numbers=(float(rng.uniform(0.0, 360.0)),), seed=int(rng.integers(2**31))
    )
