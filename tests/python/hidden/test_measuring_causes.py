"""Causes that lie in how a joint is measured: clocks, stamps, currents, counts, ratios."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

from .answer import STANDARD_ERRORS, judge
from .case import Case, hide, pose
from .designs import Scene
from .joint import Joint as HiddenJoint
from .source import Array, Source


@dataclass(frozen=True, kw_only=True)
class FastClock(Source):
    """The joint's stamps run ahead by ``size`` ppm, whatever the motion in between."""

    cause: ClassVar[str] = "clock_drift"

    def signal(self, joint: HiddenJoint, scene: Scene, run: int) -> Array:
        ahead = 1e-6 * self.size * (scene.time - scene.time[0])
        return (scene.motion.angle(scene.time + ahead) - scene.theta) * 3600.0

    def parameters(self) -> dict[str, float]:
        return {"ppm": self.size}


def draw_fast_clock(rng: np.random.Generator) -> Source:
    return FastClock()


@pytest.mark.parametrize("seed", [51, 52])
def test_clocks_that_run_apart_are_named(seed):
    answer = judge(hide(draw_fast_clock, 0.8, seed))
    assert answer.exact, answer
    assert abs(answer.scores["clock_drift.ppm"]) < STANDARD_ERRORS


@dataclass(frozen=True, kw_only=True)
class SaturatingField(Source):
    """A field that the sensor takes up less and less, from a current beside the torque's."""

    cause: ClassVar[str] = "current_coupling"

    def signal(self, joint: HiddenJoint, scene: Scene, run: int) -> Array:
        return self.size * np.tanh(self.current(scene, run) / 12.0)

    def current(self, scene: Scene, run: int) -> Array:
        level = self.chance(run).uniform(-3.0, 3.0)
        return np.asarray(level + 0.4 * scene.torque + 0.3 * np.sign(scene.velocity))

    def parameters(self) -> dict[str, float]:
        return {}


def draw_saturating_field(rng: np.random.Generator) -> Source:
    return SaturatingField(seed=int(rng.integers(2**31)))


@pytest.mark.parametrize("seed", [61, 62])
def test_the_field_of_the_current_is_named(seed):
    question = hide(draw_saturating_field, 0.8, seed)
    (source,) = question.sources
    runs = [
        replace(run, signals={"current": source.current(scene, k)})
        for k, (run, scene) in enumerate(zip(question.runs, question.scenes, strict=True))
    ]
    answer = judge(replace(question, runs=runs))
    assert answer.exact, answer


def test_without_a_current_it_is_not_told():
    assert "current_coupling" in judge(pose(Case((), 1.0, 3))).blind


@pytest.mark.parametrize("ratio", [80.0, 120.0])
def test_a_wrong_ratio_moves_all_lines_together(ratio):
    lines = (
        Harmonic("output", 1, 12.0, 30.0),
        Harmonic("motor", 1, 10.0, 50.0),
        Harmonic("motor", 2, 14.0, 100.0),
        Harmonic("wave_generator", 2, 20.0, 10.0),
    )
    runs = tuple(
        RunDesign(samples=900, reversals=(0.5,), turns=2.0, start_deg=9.0 * k) for k in range(4)
    )
    true = Simulation(Joint(ratio, "circular_spline", "motor"), lines, (), 1.5, runs)
    believed = replace(true, joint=Joint(100.0, "circular_spline", "motor"))
    (finding,) = ta.diagnose(ta.simulate(true, 5), believed, gain=False).findings
    assert finding.cause == "wrong_gear_ratio"
    assert finding.parameters["gear_ratio"].value == ratio


def scattered(stamps, step, seed):
    """Runs at four speeds whose moments or steps scatter, measured by hand."""
    rng = np.random.default_rng(seed)
    runs = []
    for speed in (2.0, 20.0, 45.0, 90.0):
        time = (np.arange(1500) + rng.random(1500)) * (720.0 / speed / 1500)
        theta = speed * time
        late = stamps * rng.laplace(size=time.size) / np.sqrt(2.0)
        indicated = theta + speed * late + rng.standard_normal(time.size) / 3600.0
        if step:
            indicated = np.round(indicated * 3600.0 / step) * step / 3600.0
        runs.append(ta.CalibrationRun(theta, indicated, 360.0, time=time))
    return runs


def test_stamps_that_scatter_are_told_from_noise_that_grows_with_speed():
    runs = scattered(2e-5, 0.0, 7)
    (finding,) = ta.diagnose(runs, Simulation(sigma_arcsec=1.0), gain=False).findings
    assert finding.cause == "timestamp_jitter"
    found = finding.parameters["sigma_s"]
    # Clipped squares of long tails are too small by a few percent.
    assert found.value == pytest.approx(2e-5, rel=0.15)


def test_a_coarse_lattice_is_the_noise():
    runs = scattered(0.0, 8.0, 8)
    (finding,) = ta.diagnose(runs, Simulation(sigma_arcsec=1.0), gain=False).findings
    assert finding.cause == "quantisation"
    assert finding.parameters["step_arcsec"].value == pytest.approx(8.0)
    fine = ta.diagnose(scattered(0.0, 0.5, 8), Simulation(sigma_arcsec=1.0), gain=False)
    assert fine.findings == []
