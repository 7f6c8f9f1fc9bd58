"""Orders that could stand for those retained, against least squares with each put in its place."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.lookalikes import find_lookalikes
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings
from trueangle.runs.aliasing import Positions, distinct_positions

SEED = 71_300
HIGHEST = 40


def units_of(
    shifts: list[float], orders: list[float], sizes: list[float], noise: float = 0.0
) -> tuple[list[ZeroGroupReadings], Positions]:
    """Grids of 36 positions a little apart, each with a zero of its own and unlike weights."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    runs, units = [], []
    for k, shift in enumerate(shifts):
        theta = np.arange(36) * 10.0 + shift
        error = sum(
            size * np.sin(np.radians(order * theta) + order)
            for order, size in zip(orders, sizes, strict=True)
        )
        error = error + noise * rng.normal(size=36) + 3.0 * k
        weight = rng.uniform(0.5, 2.0, 36)
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
        units.append(ZeroGroupReadings(theta / 360.0, error, weight, str(k)))
    return units, distinct_positions(runs)


def squares(units: list[ZeroGroupReadings], orders: list[float]) -> float:
    """What zeros of the units and these orders leave, weighted."""
    rows = []
    for k, unit in enumerate(units):
        angle = 2.0 * np.pi * np.outer(unit.turns, orders)
        zeros = np.zeros((unit.turns.size, len(units)))
        zeros[:, k] = 1.0
        rows.append(np.hstack([zeros, np.cos(angle), np.sin(angle)]))
    root = np.sqrt(np.concatenate([unit.weights for unit in units]))
    design = root[:, None] * np.vstack(rows)
    error = root * np.concatenate([unit.error for unit in units])
    rest = error - design @ np.linalg.lstsq(design, error, rcond=1e-9)[0]
    return float(rest @ rest)


def losses(units: list[ZeroGroupReadings], orders: list[float], order: float) -> dict[int, float]:
    """By how much each whole order that is not there leaves more in the place of this one."""
    rest = [k for k in orders if k != order]
    best = squares(units, orders)
    free = [m for m in range(1, HIGHEST + 1) if m not in orders]
    return {m: squares(units, [*rest, m]) - best for m in free}


@pytest.mark.parametrize(
    ("orders", "sizes"),
    [
        ([8.0], [2.0]),
        ([3.0, 8.0], [1.0, 2.0]),
        ([5.0, 40.0], [1.0, 0.3]),
        # Half orders are no whole ones, and 76 is beyond those that are looked at.
        ([4.0, 28.5], [2.0, 1.0]),
        ([3.0, 32.7, 76.0], [1.0, 1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("shifts", [[0.0, 0.1], [0.0, 0.3, 0.35], [0.0]])
def test_an_order_is_like_another_where_it_costs_little_in_its_place(
    shifts: list[float], orders: list[float], sizes: list[float]
) -> None:
    """From both sides of ten noise variances, for each that turns up at all."""
    units, positions = units_of(shifts, orders, sizes, noise=0.01)
    for k, order in enumerate(orders):
        cost = losses(units, orders, order)
        limits = [1e-6, 0.1, *(value for value in cost.values() if 1e-6 < value < 1.0)]
        for limit in limits:
            for share in (0.99, 1.01):
                variance = share * limit / 10.0  # twice the logarithm of e^5
                found = find_lookalikes(units, positions, orders, variance, HIGHEST)[k]
                expected = {m: loss for m, loss in cost.items() if loss < share * limit}
                assert list(found) == sorted(expected)
                assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)
