"""No order has a negative variance, however little of a turn the readings tell orders apart by."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.noisespectrum import NoiseSpectrum
from trueangle.fitting.orders.significance import examine_orders
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings

ORDERS = [*range(1, 18), 225.0, 450.0, 675.0, 900.0]


@pytest.mark.parametrize("seed", [34, 38, 44, 47, 1001, 1002, 1003])
def test_variances_of_orders_on_an_arc_are_not_negative(seed):
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    size, arc = int(rng.integers(100, 1500)), rng.choice([2.0, 5.0, 24.0, 60.0]) / 360.0
    units = [
        ZeroGroupReadings(
            np.sort(rng.uniform(0.0, arc, size)), rng.normal(size=size), np.ones(size), ""
        )
        for _ in range(rng.integers(1, 4))
    ]
    sums = harmonic_sums(units, ORDERS)
    noise = NoiseSpectrum.flat(1.0, 100.0, len(ORDERS))
    for _ in range(20):
        chosen = rng.choice(len(ORDERS), rng.integers(2, 14), replace=False).tolist()
        test = examine_orders(sums, chosen, range(len(ORDERS)), noise, None)
        assert not (test.variance < 0.0).any()
        assert not (test.statistic < 0.0).any()


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
