"""Sensors that round: what the rounding would show is no cause, and what is beyond it is."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from coarse import Sensor, any_sensor
from trueangle.simulation import Joint, Simulation

DIRECT = Simulation(joint=Joint(gear_ratio=1.0, fixed_member="none"))


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
    """A zero that jumps to and fro by counts, in time: noise before the rounding is not all."""
    sensor = Sensor(12, 150, 3, True, 0.1, 0.0, 1, 0)
    rng, runs = np.random.default_rng(0), []
    for run in sensor.read():
        jumps = 2.0 * (np.cumsum(rng.random(150) < 0.04) % 2) * sensor.count
        runs.append(
            ta.CalibrationRun(run.reference, run.indicated + jumps, period=360.0, time=run.time)
        )
    result = ta.diagnose(runs, DIRECT, gain=False)
    assert result.unexplained.found
    assert not any(finding.confirmed for finding in result.findings)
    assert result.noise > 3600.0 * sensor.count / np.sqrt(12.0)
