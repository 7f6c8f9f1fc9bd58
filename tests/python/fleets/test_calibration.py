"""Sums of the runs of one unit: in blocks of readings, as of all at once."""

import tracemalloc

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.robust import without_spikes
from trueangle.fleets import calibration
from trueangle.fleets.calibration import CalibrationSums, normal_matrix, order_columns
from trueangle.fleets.sums import candidate_orders, worth_keeping

SEED = 4_711
ORDERS = np.arange(1.0, 111.0)

#: Bytes beyond the run itself; the columns of all of its readings take 350 MB.
MOST = 100 << 20


def made_run(rows, weighted=False):
    rng = np.random.default_rng(SEED)
    theta = np.linspace(0.0, 720.0, rows, endpoint=False)
    error = 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 1e-3, rows)
    weights = rng.uniform(0.5, 2.0, rows) if weighted else None
    return ta.CalibrationRun(theta, theta + error, period=360.0, weights=weights)


@pytest.mark.parametrize("weighted", [False, True])
def test_blocks_give_the_sums_of_all_readings(weighted, monkeypatch):
    print("seed", SEED)
    run, orders = made_run(101, weighted), np.array([1.0, 2.0, 50.5])
    monkeypatch.setattr(calibration, "_BLOCK", 7)
    sums = CalibrationSums()
    sums.add(run, orders, True)
    run = without_spikes(run)
    size = len(run)
    share = np.ones(size) if run.weights is None else run.weights
    design = np.column_stack([order_columns(run.reference, orders, 360.0), run.centred_error])
    mean = np.average(design, axis=0, weights=share)
    wanted = (design - mean).T @ (share[:, None] * (design - mean))
    np.testing.assert_allclose(sums.means[0], mean, atol=1e-14)
    (found,) = sums.runs
    np.testing.assert_allclose(found.gram, wanted[:-1, :-1], atol=1e-11)
    np.testing.assert_allclose(found.moment, wanted[:-1, -1], atol=1e-12)
    whole = np.column_stack([np.full(size, np.sqrt(0.5)), design[:, :-1]])
    np.testing.assert_allclose(
        normal_matrix(run.reference, orders, 360.0), whole.T @ whole, atol=1e-11
    )


def test_a_long_run_takes_no_memory_for_each_reading():
    run = made_run(200_000)
    tracemalloc.start()
    try:
        CalibrationSums().add(run, ORDERS, True)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < MOST


@pytest.mark.parametrize(("more", "told"), [(1, False), (2, True), (9, True)])
def test_a_run_tells_a_scatter_where_it_has_readings_beyond_its_pattern(more: int, told: bool):
    """Two orders and a zero are five numbers: a run with no more readings has no scatter."""
    orders = np.array([1.0, 2.0])
    sums = CalibrationSums()
    rng = np.random.default_rng(more)
    for size in (4 + more, 40):
        place = np.sort(rng.uniform(0.0, 360.0, size))
        run = ta.CalibrationRun(place, place + rng.normal(0.0, 0.01, size), 360.0)
        sums.add(run, orders, True)
    squares, freedom = sums.within()
    assert freedom == (more - 1.0 + 35.0 if told else 0.0)
    assert (squares > 0.0) == told


ORDERS_SEED = 52_700
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
    print("seed", ORDERS_SEED)
    rng = np.random.default_rng(ORDERS_SEED)
    fleets = 150
    found = [kept(rng) for _ in range(fleets)]
    assert all({1, 2} <= orders for orders in found)
    told = sum(bool(orders - {1, 2}) for orders in found)
    print("told", told)
    # 1 %, and 3.5 standard deviations of the count.
    assert told <= 0.01 * fleets + 3.5 * np.sqrt(0.01 * fleets)


def test_an_order_is_kept_where_all_units_together_tell_it():
    """Chi-squared of 12 degrees of freedom: 6 units of size 0.55, 6 (0.55)^2 60 / 1 = 109."""
    rng = np.random.default_rng(ORDERS_SEED + 1)
    found = [kept(rng, [(7, 0.55), (13, 0.55)]) for _ in range(12)]
    assert all({7, 13} <= orders for orders in found)


@pytest.mark.parametrize("correlation", [0.3, 0.6, 0.9])
def test_correlated_noise_adds_no_order(correlation):
    rng = np.random.default_rng(ORDERS_SEED + 2)
    found = [kept(rng, [(1, 20.0), (2, 6.0)], 12, correlation) for _ in range(20)]
    assert sum(len(orders - {1, 2}) for orders in found) <= 1
