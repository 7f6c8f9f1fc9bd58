"""A loop in torque of another form than the library's: elements that stick and then slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import TorqueHysteresis
from trueangle.joint.signals import join_runs

from .answer import STANDARD_ERRORS, judge
from .case import Case, hide, pose
from .designs import Scene
from .joint import Joint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class SlippingTeeth(Source):
    """Prandtl's stop operators in torque: each follows the torque up to its limit."""

    cause: ClassVar[str] = "torque_hysteresis"
    limits: tuple[float, ...] = (0.15, 0.4, 0.9)  # Nm

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        total = np.zeros(scene.torque.size)
        for limit in self.limits:
            stop, before = 0.0, scene.torque[0]
            for k, torque in enumerate(scene.torque):
                stop = float(np.clip(stop + torque - before, -limit, limit))
                before = torque
                total[k] += stop / limit
        return self.size * total / len(self.limits)

    def parameters(self) -> dict[str, float]:
        return {"half_width_arcsec": self.size}


def draw_slipping_teeth(rng: np.random.Generator) -> Source:
    return SlippingTeeth(limits=tuple(rng.uniform(0.1, 1.0, 3)))


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_loop_in_torque_is_named(seed):
    answer = judge(hide(draw_slipping_teeth, 0.5, seed))
    assert answer.exact, answer
    assert abs(answer.scores["torque_hysteresis.half_width_arcsec"]) < STANDARD_ERRORS
    assert answer.shares["torque_hysteresis"] > 0.8


def test_under_one_constant_load_it_is_not_told():
    assert "torque_hysteresis" in judge(pose(Case((), 1.0, 3, "one_load_constant"))).blind


def test_the_loop_has_two_values_at_one_torque():
    torque = np.concatenate([np.linspace(0, 5, 50), np.linspace(5, -5, 100)])
    torque = np.concatenate([torque, np.linspace(-5, 5, 100)])
    theta = np.linspace(0.0, 90.0, torque.size)
    run = ta.CalibrationRun(theta, theta, period=360.0, torque=torque)
    loop = TorqueHysteresis.loop(join_runs([run]), 0.5)
    falling, rising = loop[100], loop[200]
    assert torque[100] == pytest.approx(torque[200], abs=0.2)
    # Ten spans after it turned the loop is at its width.
    assert falling == pytest.approx(-1.0, abs=1e-4)
    assert rising == pytest.approx(1.0, abs=1e-4)
