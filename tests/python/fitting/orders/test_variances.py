"""No order has a negative variance, however little of a turn the readings tell orders apart by."""

import numpy as np
import pytest

import trueangle as ta

ORDERS = [*range(1, 18), 225.0, 450.0, 675.0, 900.0]


@pytest.mark.parametrize("seed", [1, 2])
def test_an_arc_of_a_worm_is_selected_or_refused(seed):
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    angle = 130.0 + np.linspace(0.0, 24.0, 700)
    error = 0.008 * np.sin(np.radians(225.0 * angle)) + 0.01 * np.sin(np.radians(7.0 * angle))
    error += np.cumsum(rng.normal(0.0, 2e-4, angle.size))
    run = ta.CalibrationRun(angle, angle + error, 360.0)
    selection = ta.select_orders(run, gear_ratio=225.0, fixed_member="none")
    assert all(row.standard_error >= 0.0 for row in selection.table)
