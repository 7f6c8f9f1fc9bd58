"""Lattices: the sensor's own, and those that a design puts there."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.grid import lattice_step, table_move
from trueangle.joint.signals import join_runs
from trueangle.simulation import Simulation

LINES = ((1, 60.0, 40.0), (2, 25.0, 100.0))


def table(n: int, runs: int, rng: np.random.Generator, back: bool = False) -> list:
    """Readings at indicated angles of equal steps, with order 1 and 2 and 2 arcsec of noise."""
    found = []
    for _ in range(runs):
        grid = np.arange(n) * 360.0 / n
        grid = np.concatenate([grid, grid[::-1]]) if back else grid
        error = sum(a * np.sin(np.radians(k * grid + p)) for k, a, p in LINES)
        noise = rng.normal(0.0, 2.0, grid.size)
        found.append(ta.CalibrationRun(grid - (error + noise) / 3600.0, grid, period=360.0))
    return found


def test_a_table_is_told_from_a_sensor_that_rounds():
    even = np.arange(73) / 72.0
    assert table_move([even, even[::-1] + 0.25], 1.0 / 72.0) == pytest.approx(1.0 / 72.0)
    assert table_move([even * 3.0], 1.0 / 72.0) == pytest.approx(3.0 / 72.0)
    # A slow sensor lingers at its counts, a fast one skips unevenly.
    slow = np.floor(np.linspace(0.0, 40.0, 200)) / 72.0
    fast = np.floor(np.linspace(0.0, 40.0, 15)) / 72.0
    assert lattice_step(slow) == pytest.approx(1.0 / 72.0)
    assert table_move([slow], 1.0 / 72.0) == 0.0
    assert table_move([fast], 1.0 / 72.0) == 0.0
    assert table_move([even], 0.0) == 0.0


@pytest.mark.parametrize(("n", "positions"), [(36, 36), (80, 80), (400, 400)])
def test_a_lattice_of_the_design_is_no_count(n, positions):
    signals = join_runs(table(n, 2, np.random.default_rng(n)))
    assert signals.count == 0.0
    assert signals.grid is not None
    assert signals.grid.positions == positions


@pytest.mark.parametrize("n", [24, 80, 100, 200, 400])
@pytest.mark.parametrize(("runs", "back"), [(1, False), (3, True)])
def test_tables_of_equal_steps_have_low_orders_and_no_counts(n, runs, back):
    result = ta.diagnose(table(n, runs, np.random.default_rng([n, runs])), Simulation())
    found = {f.parameters["order"].value: f for f in result.findings if f.cause == "missing_order"}
    assert [f.cause for f in result.findings] == ["missing_order"] * 2
    for order, amplitude, _ in LINES:
        size = found[order].parameters["amplitude_arcsec"]
        assert abs(size.value - amplitude) < 4.0 * size.std
    assert result.noise == pytest.approx(2.0, rel=0.4)
