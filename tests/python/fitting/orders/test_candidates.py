"""Orders that are looked at: a reference's own with two side bands to each side."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.candidates import choose_candidates
from trueangle.runs.aliasing import distinct_positions


@pytest.mark.parametrize(
    ("asked", "looked_at"),
    [
        ([36], [34, 35, 36, 37, 38]),
        ([36, 72], [34, 35, 36, 37, 38, 70, 71, 72, 73, 74]),
        # Below the third order side bands are the joint's own.
        ([3], [3, 4, 5]),
        ([1], [1, 3]),
    ],
)
def test_a_reference_order_has_two_side_bands_to_each_side(asked, looked_at):
    rng = np.random.default_rng(4)
    x = np.sort(rng.uniform(0.0, 360.0, 2000))
    positions = distinct_positions(ta.CalibrationRun(x, x, 360.0))
    found = choose_candidates(positions, None, None, "none", asked)
    assert found.reference == tuple(float(order) for order in looked_at)
    assert set(found.reference) <= set(found.orders)
