"""One question of the exam: measured runs that hide known causes, and the simulation."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trueangle import CalibrationRun

from .causes import draw
from .designs import DESIGNS, RICH, Design, Scene
from .joint import Joint, random_joint
from .measurement import Habit, measure, random_habit
from .source import Source

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """What is hidden, how strongly, and in which design of runs."""

    causes: tuple[str, ...]
    scale: float = 1.0
    seed: int = 0
    design: str = "rich"
    noise: str = "normal"

    def __str__(self) -> str:
        hidden = "+".join(self.causes) or "none"
        return f"{hidden} x{self.scale:g} in {self.design}, {self.noise} noise, seed {self.seed}"

    def rng(self) -> np.random.Generator:
        """Random numbers of this case; the scale has no part in them."""
        name = "+".join(self.causes) + self.design + self.noise
        return np.random.default_rng([self.seed, zlib.crc32(name.encode())])


@dataclass(frozen=True)
class Question:
    """The data of a case and everything that is true about them."""

    case: Case
    joint: Joint
    scenes: Sequence[Scene]
    sources: tuple[Source, ...]
    habit: Habit
    runs: list[CalibrationRun]

    @property
    def simulation(self) -> str:
        """TOML text of the simulation, which knows the pattern and not the effect."""
        return self.joint.simulation(self.habit.sigma)

    def visible(self) -> float:
        """Energy of the hidden signals over the noise variance, base harmonics taken out.

        The chi-square that a detector would gain who knew the signal in advance: below
        about 25 no method can name the cause reliably.
        """
        total = sum(
            np.concatenate(source.signals(self.joint, self.scenes)) for source in self.sources
        )
        if np.ndim(total) == 0:
            return 0.0
        theta = np.concatenate([scene.theta for scene in self.scenes])
        angle = np.radians(theta)[:, None] * self.joint.orders
        base = np.column_stack([np.ones(theta.size), np.cos(angle), np.sin(angle)])
        rest = total - base @ np.linalg.lstsq(base, total, rcond=None)[0]
        return float(rest @ rest) / self.habit.sigma**2


def pose(case: Case) -> Question:
    """Draw the joint, the design's runs, the effects and the measurement of a case."""
    rng = case.rng()
    joint = random_joint(rng)
    habit = random_habit(rng)
    design = DESIGNS[case.design]
    loads_only_linear = "stiffening_compliance" not in case.causes
    if case.design == "rich" and loads_only_linear and rng.integers(2):
        design = DESIGNS["rich_constant_load"]
    scenes = design.scenes(rng)
    # Sizes are those of the rich design, also where the actual one cannot see the effect.
    rich = scenes if case.design == "rich" else RICH.scenes(rng)
    sources = tuple(draw(cause, case.scale, joint, rich, rng) for cause in case.causes)
    for source in sources:
        joint = source.adapt(joint)
    if design.travel == "static":
        habit = Habit(sigma=habit.sigma, resolution=habit.resolution)
    habit = Habit(**{**vars(habit), "noise": case.noise})
    runs = measure(joint, design, scenes, sources, habit, rng)
    return Question(case, joint, scenes, sources, habit, runs)


def hide(
    build: Callable[[np.random.Generator], Source],
    rms: float,
    seed: int,
    design: Design = RICH,
) -> Question:
    """A question with one hidden effect of any form, ``rms`` arcsec over the rich design."""
    rng = np.random.default_rng([seed, zlib.crc32(build.__name__.encode())])
    joint = random_joint(rng)
    habit = random_habit(rng)
    scenes = design.scenes(rng)
    source = build(rng).sized(joint, scenes, rms)
    joint = source.adapt(joint)
    runs = measure(joint, design, scenes, (source,), habit, rng)
    case = Case((source.cause,), 1.0, seed, design.name)
    return Question(case, joint, scenes, (source,), habit, runs)
