"""Play that differs from place to place, in another form than a few lines: a worn sector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from .answer import judge
from .case import Case, hide, pose
from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class WornSector(Source):
    """Teeth worn over a sector: play that rises and falls smoothly there, crossed in 0.01 deg."""

    cause: ClassVar[str] = "direction_dependent_pattern"
    middle: float  # degrees
    width: float  # degrees, the half of a raised cosine

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        _, direction, travel = scene.motion.since_reversal(scene.time)
        away = (scene.theta - self.middle + 180.0) % 360.0 - 180.0
        worn = np.where(
            np.abs(away) < self.width, 0.5 + 0.5 * np.cos(np.pi * away / self.width), 0.0
        )
        # Its mean over the turn is play, a cause of its own.
        worn -= self.width / 360.0
        return self.size * worn * direction * np.clip(2.0 * travel / 0.01 - 1.0, -1.0, 1.0)


def draw_worn_sector(rng: np.random.Generator) -> Source:
    return WornSector(middle=float(rng.uniform(0, 360)), width=float(rng.uniform(100, 170)))


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_play_that_differs_from_place_to_place_is_named(seed):
    answer = judge(hide(draw_worn_sector, 0.7, seed))
    assert answer.exact, answer
    assert answer.shares["direction_dependent_pattern"] > 0.8


def test_in_one_direction_it_is_not_told():
    assert "direction_dependent_pattern" in judge(pose(Case((), 1.0, 3, "one_direction"))).blind
