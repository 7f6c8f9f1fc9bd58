"""Levels of a factor do not depend on where a rounded value falls."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.levels import levels_of_runs
from trueangle.effects import TorsionalCompliance
from trueangle.effects.blindspots import blind_spots
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import RunDesign, Simulation, simulate


def hides_drift(temperatures):
    """Whether runs that warm by 15 K from these temperatures on leave the runs' zeros in doubt."""
    runs = tuple(
        RunDesign(f"{k}", temperature_C=t, temperature_end_C=t + 15.0)
        for k, t in enumerate(temperatures)
    )
    signals = join_runs(simulate(Simulation(runs=runs), 0))
    noise = np.random.default_rng(0).standard_normal(len(signals))
    spots = blind_spots(Regression.of(signals, noise, Simulation().surroundings))
    return any("zero_slip" in spot.causes for spot in spots)


@pytest.mark.parametrize("middle", [20.0, 20.25, 20.5, 20.75])
def test_runs_are_one_level_unless_they_are_a_kelvin_apart(middle):
    assert not hides_drift([middle - 0.02, middle, middle + 0.02])
    assert hides_drift([middle, middle + 1.1, middle + 2.2])


@pytest.mark.parametrize("count", [4, 7, 11, 12, 21])
def test_even_steps_of_a_load_are_levels_however_many_they_are(count):
    """A stiffness test in equal steps: no gap parts one load from the next."""
    loads = np.linspace(-10.0, 10.0, count)
    runs = tuple(RunDesign(f"{k}", samples=60, torque_Nm=t) for k, t in enumerate(loads))
    known = Simulation(sigma_arcsec=2.0, runs=runs)
    signals = join_runs(simulate(known, 0))
    level, values = levels_of_runs(signals, "torque")
    assert len(values) == min(count, 5)
    assert np.all(np.diff(level) >= 0)
    of_level = [signals.torque[level == k] for k in range(len(values))]
    np.testing.assert_allclose(values, [np.mean(torque) for torque in of_level], atol=1e-12)
    assert np.all(np.diff(values) > 0.0)
    # No part of the range holds more than twice the loads of another.
    sizes = [np.unique(torque).size for torque in of_level]
    assert max(sizes) <= 2 * min(sizes)
    (found,) = ta.diagnose(
        simulate(known.with_effects([TorsionalCompliance(1.0)]), 2), known
    ).findings
    assert found.cause == "torsional_compliance"
    assert found.gain.by_level.held_out


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rest", [0.0, 0.3, 0.9])
def test_a_speed_is_that_of_the_readings_that_move(rest, sign):
    """A run that mostly rests counts by how fast it went, and one that only rests as at rest."""
    runs = []
    for k, speed in enumerate((6.0, 15.0, 30.0, 15.0, 6.0, 0.0)):
        velocity = np.full(100, sign * speed)
        velocity[: round(100 * rest)] = 0.0
        theta = np.cumsum(velocity) * 0.01
        runs.append(ta.CalibrationRun(theta, theta, 360.0, velocity=velocity, label=f"{k}"))
    level, values = levels_of_runs(join_runs(runs), "velocity")
    assert values == pytest.approx([0.0, 6.0, 15.0, 30.0])
    assert level[::100].tolist() == [1, 2, 3, 2, 1, 0]
