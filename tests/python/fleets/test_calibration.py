"""Sums of the runs of one unit: in blocks of readings, as of all at once."""

import tracemalloc

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.robust import without_spikes
from trueangle.fleets import calibration
from trueangle.fleets.calibration import CalibrationSums, normal_matrix, order_columns

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
