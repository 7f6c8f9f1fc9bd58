"""Channels read one after the other, by the arctangent of two readings and not by its series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from .answer import STANDARD_ERRORS, judge
from .case import hide
from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class LateSine(Source):
    """The cosine of the motor's sensor now and its sine ``size`` x 10 us later."""

    cause: ClassVar[str] = "channel_skew"
    stands: float  # radians

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        ratio = joint.cycles("motor")
        later = scene.motion.angle(scene.time + 1e-5 * self.size)
        now = np.radians(ratio * scene.theta) + self.stands
        read = np.arctan2(np.sin(np.radians(ratio * later) + self.stands), np.cos(now))
        electrical = np.angle(np.exp(1j * (read - now)))
        return np.degrees(electrical) / ratio * 3600.0

    def parameters(self) -> dict[str, float]:
        return {"delay_s": 1e-5 * self.size}


def draw_late_sine(rng: np.random.Generator) -> Source:
    return LateSine(stands=float(rng.uniform(0.0, 6.283)))


@pytest.mark.parametrize("seed", [41, 42, 43])
def test_channels_read_one_after_the_other_are_named(seed):
    answer = judge(hide(draw_late_sine, 0.6, seed))
    assert answer.exact, answer
    (score,) = answer.scores.values()
    assert abs(score) < STANDARD_ERRORS
