"""Orders that a fleet keeps: those above noise, and of noise none."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fleets.sums import candidate_orders, worth_keeping

SEED = 52_700
PLACES = np.arange(0.0, 360.0, 3.0)


def kept(rng, lines=(), count=6, correlation=0.0):
    """Orders kept of units, each line in every unit at another phase; sigma is 1."""
    units = []
    for _ in range(count):
        error = rng.normal(0.0, 1.0, PLACES.size)
        for i in range(1, PLACES.size):
            error[i] = correlation * error[i - 1] + np.sqrt(1.0 - correlation**2) * error[i]
        for order, size in lines:
            error += size * np.sin(np.radians(order * PLACES) + rng.uniform(0.0, 2.0 * np.pi))
        units.append([ta.CalibrationRun(PLACES, PLACES + error / 3600.0, 360.0)])
    every = [run for runs in units for run in runs]
    shafts = worth_keeping(units, candidate_orders(every, None, "none", None))
    return {order for shaft in shafts for order in shaft.orders}


def test_orders_of_noise_alone_are_kept_in_one_fleet_of_a_hundred():
    """All candidates together; eccentricity and tilt stay in any case."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    fleets = 150
    found = [kept(rng) for _ in range(fleets)]
    assert all({1, 2} <= orders for orders in found)
    told = sum(bool(orders - {1, 2}) for orders in found)
    print("told", told)
    # 1 %, and 3.5 standard deviations of the count.
    assert told <= 0.01 * fleets + 3.5 * np.sqrt(0.01 * fleets)


def test_an_order_is_kept_where_all_units_together_tell_it():
    """Chi-squared of 12 degrees of freedom: 6 units of size 0.55, 6 (0.55)^2 60 / 1 = 109."""
    rng = np.random.default_rng(SEED + 1)
    found = [kept(rng, [(7, 0.55), (13, 0.55)]) for _ in range(12)]
    assert all({7, 13} <= orders for orders in found)


@pytest.mark.parametrize("correlation", [0.3, 0.6, 0.9])
def test_correlated_noise_adds_no_order(correlation):
    rng = np.random.default_rng(SEED + 2)
    found = [kept(rng, [(1, 20.0), (2, 6.0)], 12, correlation) for _ in range(20)]
    assert sum(len(orders - {1, 2}) for orders in found) <= 1
