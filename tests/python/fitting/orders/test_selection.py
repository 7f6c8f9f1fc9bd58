"""What a selection holds out, counts and tells where two orders look alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import NoOrderError

SEED = 71_400


def runs_of(
    count: int, mounts: int = 1, period: float = 360.0, size: int = 60
) -> list[ta.CalibrationRun]:
    """Order 3 and noise, read anywhere; each mount has a zero of its own."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(count):
        x = np.sort(rng.uniform(0.0, 1.0, size))
        mount = np.repeat(np.arange(mounts), -(-size // mounts))[:size]
        error = 3e-4 * np.sin(6.0 * np.pi * x + 0.4) + 3e-5 * rng.normal(size=size) + 1e-3 * mount
        where = None if mounts == 1 else period * mount / 12.0
        found.append(ta.CalibrationRun(period * x, period * (x + error), period, mount=where))
    return found


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi, 1.0])
@pytest.mark.parametrize(
    ("count", "mounts", "holdout", "zeros"),
    [
        (1, 1, "block of neighbouring positions", 1),
        (3, 1, "run", 3),
        (1, 3, "mount", 3),
        (3, 2, "mount", 6),
    ],
)
def test_each_zero_and_coefficient_costs_a_degree_of_freedom(
    count: int, mounts: int, holdout: str, zeros: int, period: float
) -> None:
    found = ta.select_orders(runs_of(count, mounts, period), candidates=range(1, 9))
    assert (found.orders, found.holdout.partition(" predicted")[0]) == ((3,), f"each {holdout}")
    assert (found.samples, found.runs, found.period) == (60 * count, count, period)
    assert found.noise.degrees_of_freedom == 60 * count - zeros - 2
    assert math.sqrt(found.noise.variance) == pytest.approx(3e-5 * period, rel=0.3)


def test_the_error_held_out_is_that_of_each_run_under_the_others() -> None:
    """Without an order, and with the one that is retained, about the mean of the run."""
    runs = runs_of(4)
    found = ta.select_orders(runs, candidates=range(1, 9))
    designs, errors = [], []
    for run in runs:
        x = np.radians(3.0 * run.reference)
        columns = np.column_stack([np.cos(x), np.sin(x)])
        designs.append(columns - columns.mean(axis=0))
        error = run.indicated - run.reference
        errors.append(error - error.mean())
    before = float(sum(error @ error for error in errors))
    after = 0.0
    for i in range(4):
        rest = [j for j in range(4) if j != i]
        others = np.concatenate([designs[j] for j in rest])
        b = np.linalg.lstsq(others, np.concatenate([errors[j] for j in rest]), rcond=None)[0]
        after += float(np.sum((errors[i] - designs[i] @ b) ** 2))
    expected = (math.sqrt(before / 240.0), math.sqrt(after / 240.0))
    assert found.holdout_rms == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("true", [8, 28])
def test_two_that_are_alike_share_their_probability(
    true: int,
) -> None:
    """Grids of 36 positions 0.3 deg apart turn 28 against 8 by 11 deg: either may explain best."""
    print("seeds", SEED, "to", SEED + 11)
    told = set()
    for k, size in enumerate(np.geomspace(0.008, 0.05, 12)):
        rng = np.random.default_rng(SEED + k)
        runs, rows = [], []
        for zero, shift in enumerate((0.0, 0.3)):
            theta = np.arange(36) * 10.0 + shift
            error = size * np.sin(np.radians(true * theta)) + 0.01 * rng.normal(size=36)
            runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
            rows.append((theta, error, np.eye(2)[[zero] * 36]))

        def left(order: int, rows=rows) -> float:
            angle = [np.radians(order * theta) for theta, _, _ in rows]
            design = np.vstack(
                [
                    np.column_stack([own, np.cos(x), np.sin(x)])
                    for x, (_, _, own) in zip(angle, rows, strict=True)
                ]
            )
            error = np.concatenate([error for _, error, _ in rows])
            rest = error - design @ np.linalg.lstsq(design, error, rcond=None)[0]
            return float(rest @ rest)

        found = ta.select_orders(runs, candidates=range(1, 36))
        if len(found.orders) != 1:
            continue
        (order,) = found.orders
        # They share their probability as their residuals say, the noise being what it is.
        chance = {k: found.row(k).probability for k in (8, 28)}
        assert chance[order] > 0.5
        assert 0.8 < sum(chance.values()) < 1.1
        # The lower is the likelier before any reading, as 1 / k.
        mine, other = (
            left(k) / (2.0 * found.noise.variance) + math.log(k) for k in (order, 36 - order)
        )
        assert mine < other
        told.add(order)
        (row,) = [row for row in found.table if row.retained]
        other = 36 - row.order
        cost = left(other) - left(row.order)
        assert (other in row.aliases) == (cost < 10.0 * found.noise.variance)
    assert true in told


@pytest.mark.parametrize("frequency", [None, 81.4])
def test_a_line_of_a_fixed_frequency_is_no_order_of_one_run(frequency):
    """The speed varies: an order keeps its place, a line in time its frequency."""
    rng = np.random.default_rng(5)
    time = np.linspace(0.0, 1.0, 900)
    theta = 360.0 * (time + 0.01 * np.sin(2.0 * np.pi * time))
    place = 81.0 * np.radians(theta) if frequency is None else 2.0 * np.pi * frequency * time
    error = 0.3 * np.cos(np.radians(theta)) + 0.05 * np.cos(place) + rng.normal(0.0, 0.02, 900)
    run = ta.CalibrationRun(theta, theta + error, 360.0, time=time)
    found = ta.select_orders([run])
    near = {row.order: row.verdict for row in found.table if 75 < row.order < 88}
    if frequency is None:
        assert found.orders == (1, 81)
    else:
        assert found.orders == (1,)
        assert "in time" in near.values()
        left = run.indicated - run.reference - ta.fit([run]).model.error(run.reference)
        assert np.std(left) > 0.035  # the line is not corrected


def test_each_run_of_the_magnetic_encoder_corrects_the_others(data_dir):
    """A line of 255 Hz is in every run, and orders 1 to 5; with them a table of 64 is 0.082 deg."""
    runs = ta.read_runs(data_dir / "rm44_repeat.csv")
    for k, run in enumerate(runs[::3]):
        model = ta.fit([run]).model
        left = [
            other.centred_error - model.error(other.reference)
            for other in runs
            if other is not runs[3 * k]
        ]
        assert np.std([part - part.mean() for part in left]) < 0.0905


@pytest.mark.parametrize("sizes", [(2, 1), (3,), (2, 2), (1, 1, 2)])
def test_as_many_unknowns_as_readings_choose_no_order(sizes):
    """Two readings had fitted order 1 as 44.13 +- 0.05 where it was 60 arcsec."""
    rng = np.random.default_rng(sum(sizes))
    runs = []
    for size in sizes:
        angle = rng.uniform(0.0, 360.0, size)
        error = (60.0 * np.cos(np.radians(angle - 30.0)) + rng.uniform(-9.0, 9.0)) / 3600.0
        runs.append(ta.CalibrationRun(angle, angle + error, period=360.0))
    with pytest.raises(NoOrderError, match=rf"1 order and .* need {len(sizes) + 3} readings.*plan"):
        ta.fit(runs)
