"""Sensors that round: what the rounding would show is no cause, and what is beyond it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Joint, Simulation

DIRECT = Simulation(joint=Joint(gear_ratio=1.0, fixed_member="none"))


@dataclass(frozen=True)
class Sensor:
    """A sensor of few counts on a joint with one line, in runs there and back.

    Sizes are in counts.
    """

    bits: int
    places: int
    runs: int
    spread: bool
    noise: float
    amplitude: float
    order: int
    seed: int

    @property
    def count(self) -> float:
        """Degrees."""
        return 360.0 / 2**self.bits

    def read(self) -> list[ta.CalibrationRun]:
        rng = np.random.default_rng([self.seed, 7])
        zero, phase = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2.0 * np.pi)
        runs = []
        for k in range(self.runs):
            at = np.arange(self.places) + (rng.uniform(size=self.places) if self.spread else 0.0)
            theta = (at * 360.0 / self.places)[:: -1 if k % 2 else 1]
            error = self.amplitude * np.sin(self.order * np.radians(theta) + phase) + zero
            error = error + self.noise * rng.standard_normal(self.places)
            indicated = np.round(theta / self.count + error) * self.count
            time = 0.1 * np.arange(self.places)
            runs.append(ta.CalibrationRun(theta, indicated, period=360.0, time=time))
        return runs


def any_sensor(seed: int) -> Sensor:
    rng = np.random.default_rng([seed, 3])
    return Sensor(
        bits=int(rng.choice([10, 12, 14])),
        places=int(rng.choice([36, 72, 200, 400])),
        runs=int(rng.integers(1, 5)),
        spread=bool(rng.integers(2)),
        noise=float(rng.choice([0.0, 0.05, 0.15, 0.3])),
        amplitude=float(rng.choice([0.0, 0.0, 0.5, 1.0, 3.0])),
        order=int(rng.integers(1, 6)),
        seed=seed,
    )


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_named_but_what_the_joint_has(seed):
    """Of 60 such (seeds 0 to 59), 15 had false names when rounding was noise like any other."""
    sensor = any_sensor(seed)
    print(sensor)
    result = ta.diagnose(sensor.read(), DIRECT, gain=False)
    named = [f for f in result.findings if f.confirmed and f.cause != "quantisation"]
    for finding in named:
        assert finding.cause == "missing_order"
        assert sensor.amplitude > 0.0
        assert finding.parameters["order"].value == sensor.order
    if sensor.amplitude >= 1.0:
        assert len(named) == 1
        size = named[0].parameters["amplitude_arcsec"].value / (3600.0 * sensor.count)
        assert size == pytest.approx(sensor.amplitude, abs=0.3)


@pytest.mark.parametrize("places", [36, 400])
def test_a_sensor_without_noise_or_error_has_its_steps_alone(places):
    sensor = Sensor(12, places, 3, False, 0.0, 0.0, 1, 1)
    result = ta.diagnose(sensor.read(), DIRECT, gain=False)
    assert [f.cause for f in result.findings] == ["quantisation"]
    assert not result.unexplained.found
    step = result.findings[0].parameters["step_arcsec"].value
    assert step == pytest.approx(1296000.0 / 4096)
    assert result.noise == pytest.approx(step / np.sqrt(12.0), rel=0.1)


def test_outliers_of_a_sensor_that_rounds_are_still_outliers():
    sensor = Sensor(12, 400, 3, True, 0.15, 2.0, 2, 4)
    runs = sensor.read()
    wild = [(0, 40), (1, 111), (2, 300)]
    for run, row in wild:
        indicated = runs[run].indicated.copy()
        indicated[row] += 40.0 * sensor.count
        runs[run] = ta.CalibrationRun(
            runs[run].reference, indicated, period=360.0, time=runs[run].time
        )
    result = ta.diagnose(runs, DIRECT, gain=False)
    found = {f.cause: f for f in result.findings if f.confirmed}
    assert set(found) == {"missing_order", "outliers", "quantisation"}
    assert found["missing_order"].parameters["order"].value == 2
    assert found["outliers"].parameters["fraction"].value == pytest.approx(3 / 1200, rel=0.02)


def test_one_reading_is_as_uncertain_as_its_step_beside_what_is_unexplained():
    """A zero that jumps to and fro by a count, in time: noise before the rounding is not all."""
    sensor = Sensor(12, 400, 4, True, 0.1, 0.0, 1, 8)
    rng, runs = np.random.default_rng(8), []
    for run in sensor.read():
        jumps = (np.cumsum(rng.random(400) < 0.02) % 2) * sensor.count
        runs.append(
            ta.CalibrationRun(run.reference, run.indicated + jumps, period=360.0, time=run.time)
        )
    result = ta.diagnose(runs, DIRECT, gain=False)
    assert result.unexplained.found
    assert result.noise > 3600.0 * sensor.count / np.sqrt(12.0)
