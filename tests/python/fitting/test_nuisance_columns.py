"""Which readings, runs and orders nuisances are looked for in, and the columns they leave."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.fitting.nuisance import Nuisance
from trueangle.fitting.nuisancecolumns import taken_columns
from trueangle.fitting.nuisanceremoval import orders_beside_nuisance, take_out_nuisance
from trueangle.joint.shafts import ShaftOrders

SEED = 48_950
OUTPUT = [ShaftOrders("output", 1.0, (1, 2))]


def moved(turns: float, size: int = 40, period: float = 360.0, **more) -> ta.CalibrationRun:
    angle = np.linspace(0.0, turns * period, size)
    return ta.CalibrationRun(angle, angle + 1e-4 * period * np.sin(np.arange(size)), period, **more)


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi, 1.0])
@pytest.mark.parametrize(
    ("turns", "first", "of_a_worm"), [(0.25, 2, 1), (0.0625, 8, 1), (0.0, None, None), (3.0, 1, 1)]
)
def test_orders_come_half_a_cycle_over_the_longest_travel(
    turns: float, first: int | None, of_a_worm: int | None, period: float
) -> None:
    runs = [moved(turns / 2.0, period=period), moved(turns, period=period)]
    found = {s.name: s for s in orders_beside_nuisance(runs, None, "none", {"worm": 16.0})}
    for name, lowest in (("output", first), ("worm", of_a_worm)):
        if lowest is None:
            assert name not in found
        else:
            assert found[name].orders == tuple(range(lowest, 9))
    assert {s.cycles_per_turn for s in found.values()} <= {1.0, 16.0}


@pytest.mark.parametrize(("count", "drifts"), [(24, True), (25, False)])
def test_so_many_runs_may_drift_each_by_itself(count: int, drifts: bool) -> None:
    runs = [moved(1.0, time=np.arange(40.0)) for _ in range(count)]
    if drifts:
        assert take_out_nuisance(runs, ("drift",), OUTPUT, "reference")[1].kinds == ("drift",)
        # Where time stands still nothing drifts in it.
        runs[3] = moved(1.0, time=np.full(40, 7.0))
    with pytest.raises(ArgumentError, match=r"needs time in every run \(at most 24 runs\)"):
        take_out_nuisance(runs, ("drift",), OUTPUT, "reference")


def test_columns_taken_out_are_about_the_mean_of_their_run_and_of_size_1() -> None:
    """The ramp and the direction are shared, each run has three columns of a drift for itself."""
    there = np.linspace(0.0, 720.0, 50)
    runs = []
    for size in (100, 60):
        angle = np.concatenate([there, there[::-1]])[:size]
        runs.append(ta.CalibrationRun(angle, angle, 360.0, time=np.arange(size) * 0.1))
    shared, own = taken_columns(runs, Nuisance(("ramp", "direction", "drift"), intervals=1))
    whole = np.vstack(shared)
    np.testing.assert_allclose((whole**2).mean(axis=0), 1.0, rtol=1e-9)
    for run, columns, alone in zip(runs, shared, own, strict=True):
        np.testing.assert_allclose(columns.mean(axis=0), 0.0, atol=1e-9)
        assert abs(np.corrcoef(columns[:, 0], run.unwrapped_reference)[0, 1]) > 1.0 - 1e-9
        assert np.ptp(columns[:, 1]) > 0.0
        # A cubic in time less its mean: whatever is one is made of its columns.
        assert alone.shape == (len(run), 3)
        cubic = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(run)), 3)[:, 1:]
        cubic = cubic - cubic.mean(axis=0)
        rest = cubic - alone @ np.linalg.lstsq(alone, cubic, rcond=None)[0]
        np.testing.assert_allclose(rest, 0.0, atol=1e-9)
    assert taken_columns(runs, Nuisance()) is None


@pytest.mark.parametrize(("size", "every"), [(24_001, 1), (47_999, 1), (48_000, 2), (72_000, 3)])
def test_columns_are_those_of_the_readings_that_were_looked_at(size: int, every: int) -> None:
    """What is between the readings looked at changes nothing, and leaves no columns."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    angle = np.linspace(0.0, 720.0, size)
    error = 1e-4 * angle + 0.01 * rng.normal(size=size)
    wild = error + 5.0 * (np.arange(size) % every != 0)
    slopes = []
    for shown in (error, wild):
        run = ta.CalibrationRun(angle, angle + shown, 360.0)
        _, found = take_out_nuisance([run], ("ramp",), OUTPUT, "reference")
        slopes.append(found.slope)
        assert (taken_columns([run], found) is None) == (every > 1)
    # Readings are about their run's mean, of which the wild ones move every one alike.
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-6)
    assert slopes[0] == pytest.approx(1e-4, rel=0.05)
