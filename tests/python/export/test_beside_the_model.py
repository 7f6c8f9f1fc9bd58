"""What a device does beside the model made of its table: rms and maximum by a pulse's own."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import reading

#: A model that takes a quarter of a turn off, and nothing else.
QUARTER = ta.HarmonicModel(
    [ta.Shaft("output", 1, [1], [0.0], [0.0])], 90.0, 360.0, argument="indicated"
)


@pytest.mark.parametrize("size", [0.01, -0.01])
@pytest.mark.parametrize("argument", ["indicated", "reference"])
@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("travel", [None, (90.0, 180.0), (-30.0, 60.0), (180.0, 450.0)])
def test_a_pulse_beside_the_model_has_its_rms_and_its_maximum(size, argument, whole, travel):
    """Over the travel alone, its mean apart, and a jump by a whole turn is none."""
    start, stop = travel or (0.0, 360.0)
    share = 0.2
    begin = start + 0.3 * (stop - start)
    end = begin + share * (stop - start)

    def device(places: np.ndarray) -> np.ndarray:
        angle = places * (360.0 / 2.0**32)
        assert start <= angle.min() < angle.max() < stop
        pulse = np.where((angle >= begin) & (angle < end), size, 0.0)
        return pulse + (np.where(angle > 0.5 * (start + stop), 1.0, 0.0) if whole else 0.0)

    target = SimpleNamespace(argument=argument)
    rms, largest = reading._arithmetic(QUARTER, target, device, 1, travel)
    assert rms == pytest.approx(abs(size) * math.sqrt(share * (1.0 - share)), rel=1e-4)
    assert largest == pytest.approx(abs(size) * (1.0 - share), rel=1e-4)
