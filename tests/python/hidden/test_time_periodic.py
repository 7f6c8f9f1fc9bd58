"""A disturbance bound to time, not a pure sine: a triangle whose frequency wanders a little."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from .answer import judge
from .case import hide
from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class Vibration(Source):
    """A triangle wave of some frequency, which starts anywhere in every run."""

    cause: ClassVar[str] = "time_periodic"
    frequency: float  # Hz

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        turns = self.frequency * scene.time + self.chance(run).random()
        return self.size * (4.0 * np.abs(turns % 1.0 - 0.5) - 1.0)

    def parameters(self) -> dict[str, float]:
        return {"frequency_hz": self.frequency}


def draw_vibration(rng: np.random.Generator) -> Source:
    # Below half the slowest mean rate of readings, 2.6 Hz.
    return Vibration(frequency=float(rng.uniform(0.2, 1.2)), seed=int(rng.integers(2**31)))


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_a_line_in_time_is_named(seed):
    question = hide(draw_vibration, 1.0, seed)
    answer = judge(question)
    assert answer.exact, answer
    (name,) = answer.scores
    assert name == "time_periodic.frequency_hz"
