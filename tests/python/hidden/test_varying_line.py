"""A line that grows with speed in another form than in proportion to it."""

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
class Whirl(Source):
    """An order of the output that sets in with speed and saturates, whichever way it turns."""

    cause: ClassVar[str] = "varying_line"
    order: int
    phase: float  # degrees

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        grown = np.tanh(np.abs(scene.velocity) / 40.0)
        return self.size * grown * np.sin(np.radians(self.order * scene.theta + self.phase))


def draw_whirl(rng: np.random.Generator) -> Source:
    return Whirl(order=int(rng.integers(4, 8)), phase=float(rng.uniform(0.0, 360.0)))


@pytest.mark.parametrize("seed", [71, 72])
def test_a_line_that_grows_with_speed_is_named(seed):
    answer = judge(hide(draw_whirl, 0.7, seed))
    assert answer.found[0] == "varying_line", answer
