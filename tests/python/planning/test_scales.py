"""Earlier readings beside which designs are weighed."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.signals import join_runs
from trueangle.planning.scales import MOST_READINGS, _thinned


@pytest.mark.parametrize("count", [1999, 2000, 2001, 4000, 4001, 9000])
def test_of_many_earlier_readings_as_many_as_can_be_are_looked_at(count):
    """Every second, every third and so on, from the first one on."""
    angle = np.linspace(0.0, 700.0, count)
    signals = join_runs([ta.CalibrationRun(angle, angle, 360.0)])
    found = _thinned(signals).theta
    step = next(k for k in range(1, 10) if -(-count // k) <= MOST_READINGS)
    np.testing.assert_array_equal(found, signals.theta[::step])
