"""Units of readings: their columns, what holding one out says, and their noise."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders import noise
from trueangle.fitting.orders.chosen import held_out_gains
from trueangle.fitting.orders.zerogroups import (
    GROUPS,
    MOST_UNITS,
    ZeroGroupReadings,
    unit_columns,
    zero_groups,
)
from trueangle.runs.aliasing import distinct_positions

# Normal equations of a few hundred readings, relative to their size.
ROUNDING = 1e-10


def some_units(seed=0, count=3):
    random = np.random.default_rng(seed)
    units = []
    for number in range(count):
        size = 80 + 10 * number
        turns = random.uniform(-2.0, 3.0, size)
        error = 7.0 + number + 0.3 * np.sin(2 * np.pi * 3 * turns) + random.normal(0, 0.1, size)
        units.append(ZeroGroupReadings(turns, error, random.uniform(0.5, 2.0, size), str(number)))
    return units


def design(unit, orders):
    x = 2 * np.pi * unit.turns[:, None, None] * np.asarray(orders, dtype=float)[:, None]
    columns = np.concatenate([np.cos(x), np.sin(x)], axis=2).reshape(unit.turns.size, -1)
    return columns - np.average(columns, axis=0, weights=unit.weights)


@pytest.mark.parametrize("orders", [(1, 2, 3, 200), (1, 2.5, 3, 7.3)])
@pytest.mark.parametrize("count", [3, MOST_UNITS + 5])
def test_normal_equations_are_those_of_the_design_matrix(orders, count):
    """Also of many units, which are taken together in groups."""
    units = some_units(count=count)
    parts = unit_columns(units, orders)
    assert len(parts) == (count if count <= MOST_UNITS else GROUPS)
    wanted = [0.0] * len(parts)
    for number, unit in enumerate(units):
        centred = unit.error - np.average(unit.error, weights=unit.weights)
        rows = np.column_stack([design(unit, orders), centred])
        wanted[number % len(parts)] += (rows.T * unit.weights) @ rows
    for part, products in zip(parts, wanted, strict=True):
        np.testing.assert_allclose(part.T @ part, products, atol=ROUNDING * 100)


def test_held_out_errors_are_those_of_leaving_units_out():
    units = some_units(4)
    orders = (1, 2, 3, 4)
    parts = unit_columns(units, orders)

    def left_out(*used):
        columns = np.ravel([(2 * i, 2 * i + 1) for i in used])
        total = 0.0
        for out, part in enumerate(parts):
            others = np.concatenate([other for u, other in enumerate(parts) if u != out])
            found = np.linalg.lstsq(others[:, columns], others[:, -1], rcond=None)[0]
            total += float(((part[:, -1] - part[:, columns] @ found) ** 2).sum())
        return total

    without, with_, model = held_out_gains(parts, [2, 1])
    assert model == pytest.approx(left_out(2, 1))
    assert without == pytest.approx([left_out(2, 1), left_out(2), left_out(1), left_out(2, 1)])
    assert with_ == pytest.approx([left_out(2, 1, 0), model, model, left_out(2, 1, 3)])


@pytest.mark.parametrize("sizes", [[2, 1, 7, 40], [2000, 3000]])
def test_units_have_the_errors_of_their_runs(sizes):
    """Many short runs are taken together, long ones one by one."""
    rng = np.random.default_rng(len(sizes))
    runs = []
    for k, n in enumerate(sizes):
        reference = rng.uniform(-720.0, 720.0, n)
        indicated = reference + 178.0 + 3.0 * rng.standard_normal(n) + 360.0 * (k % 2)
        runs.append(ta.CalibrationRun(reference, indicated, period=360.0))
    units, places = zero_groups(runs, whole=True)
    assert np.array_equal(places, np.arange(sum(sizes)))
    for unit, run in zip(units, runs, strict=True):
        np.testing.assert_allclose(unit.error, run.centred_error, rtol=1e-12, atol=1e-12)


def test_noise_of_repeats_is_that_of_least_squares(monkeypatch):
    """A mean for each position and unit, however the pairs that occur are found."""
    rng = np.random.default_rng(9)
    turns = [rng.integers(0, 12, 60) / 12.0, rng.integers(0, 12, 40) / 12.0, np.array([0.31, 0.31])]
    units = [ZeroGroupReadings(t, rng.standard_normal(t.size), np.ones(t.size), "") for t in turns]
    runs = [ta.CalibrationRun(360.0 * t, 360.0 * t, period=360.0) for t in turns]
    positions = distinct_positions(runs)
    unit = np.repeat(np.arange(3), [t.size for t in turns])
    y = np.concatenate([u.error for u in units])
    design = np.zeros((y.size, len(positions) + 3))
    design[np.arange(y.size), positions.index] = 1.0
    design[np.arange(y.size), len(positions) + unit] = 1.0
    left = y - design @ np.linalg.lstsq(design, y)[0]
    freedom = y.size - np.linalg.matrix_rank(design)
    for room in (noise._ROOM, 0):
        monkeypatch.setattr(noise, "_ROOM", room)
        found = noise.pure_error(units, positions)
        assert found.degrees_of_freedom == freedom
        assert found.variance == pytest.approx(left @ left / freedom, rel=1e-6)
