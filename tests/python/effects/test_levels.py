"""Levels of a factor do not depend on where a rounded value falls."""

import numpy as np
import pytest

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
def test_runs_alike_in_temperature_are_one_level(middle):
    assert not hides_drift([middle - 0.02, middle, middle + 0.02])


def test_runs_a_kelvin_apart_are_levels_of_their_own():
    assert hides_drift([20.0, 21.1, 22.2])
