"""Orders while a joint is recorded: sizes, standard errors, and when they are enough."""

import numpy as np
import pytest

from trueangle.recording.estimate import CELLS, Estimate

SEED = 52_003
JOINTS, WITHIN, HELD = 20, 1.5, 19


def fed(estimate, angle, error, rate=1000.0, tick=0.05):
    """The readings tick by tick, as they arrive, until the orders are settled."""
    step = max(int(rate * tick), 1)
    for i in range(0, angle.size, step):
        rows = slice(i, i + step)
        reference = angle[rows] % 360.0
        time = np.arange(angle.size)[rows] / rate
        estimate.add(reference, (angle[rows] + error[rows]) % 360.0, time)
        if estimate.is_settled:
            return angle[min(i + step, angle.size) - 1] / 360.0
    return np.inf


def joint(seed, turns=40):
    """A joint of one to four orders above the noise, and that noise."""
    rng = np.random.default_rng([SEED, seed])
    per_turn, count = int(rng.integers(200, 2000)), int(rng.integers(1, 5))
    orders = rng.choice(np.arange(1, 13), count, replace=False)
    noise = 10.0 ** rng.uniform(-2.5, -0.5)
    values = noise * 10.0 ** rng.uniform(0.0, 1.5, count) * np.exp(2j * np.pi * rng.random(count))
    angle = (np.arange(per_turn * turns) + rng.random(per_turn * turns)) * 360.0 / per_turn
    waves = np.exp(1j * np.radians(np.outer(angle, orders)))
    error = (waves * values).real.sum(axis=1) + rng.normal(0.0, noise, angle.size)
    return per_turn, waves, noise, angle, error


def allowed(per_turn, waves, noise, error):
    """The turn that changes no order by more than its standard error, by least squares."""
    columns = np.hstack([np.ones((error.size, 1)), waves.real, waves.imag])
    before = None
    for turns in range(1, error.size // per_turn + 1):
        rows = slice(0, turns * per_turn)
        found = np.linalg.lstsq(columns[rows], error[rows], rcond=None)[0][1:].reshape(2, -1)
        std = noise * np.sqrt(2.0 / (turns * per_turn))
        if before is not None and (np.hypot(*(found - before)) <= std).all():
            return turns
        before = found
    return np.inf


def test_it_is_enough_when_the_standard_errors_allow_it():
    print("seed", SEED)
    stops = []
    for seed in range(JOINTS):
        per_turn, waves, noise, angle, error = joint(seed)
        stop = fed(Estimate(360.0), angle, error)
        stops.append((allowed(per_turn, waves, noise, error), stop))
    print(stops)
    assert sum(abs(stop - turn) <= WITHIN for turn, stop in stops) >= HELD


def test_standard_errors_hold_what_turns_differ_by():
    """Pulls of order 1, of white noise and where it moves from turn to turn."""
    for moved in (0.0, 0.1):
        pulls = []
        for seed in range(24):
            rng = np.random.default_rng([SEED, seed])
            angle = np.arange(12 * 300) * 1.2
            each = (1.0 + moved * (rng.normal(size=12) + 1j * rng.normal(size=12))).repeat(300)
            error = (each * np.exp(1j * np.radians(angle))).real + rng.normal(0.0, 0.1, angle.size)
            estimate = Estimate(360.0)
            for rows in np.array_split(np.arange(angle.size), 240):
                estimate.add(angle[rows], angle[rows] + error[rows], rows * 1e-3)
            order = next(order for order in estimate.orders if order.order == 1)
            phase, std = np.radians(order.phase_deg), order.std_arcsec / 3600.0
            size = order.amplitude_arcsec / 3600.0
            pulls += [(size * np.sin(phase) - 1.0) / std, size * np.cos(phase) / std]
        # By their steps 11 turns have 15 degrees: Student's t has 1.07, and 48 of them tell it to
        # 11 %: within three of these.
        assert 0.72 < np.sqrt(np.mean(np.square(pulls))) < 1.42, (moved, pulls)


def test_a_drift_is_not_enough():
    """An order that still moves is waited for."""
    angle = np.arange(30 * 500) * 0.72
    warming = 1.0 - np.exp(-angle / 3600.0)
    error = warming * np.sin(np.radians(angle)) + np.random.default_rng(1).normal(
        0, 0.01, angle.size
    )
    assert fed(Estimate(360.0), angle, error) > 15.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_travel_knows_where_it_was_and_which_way(sign):
    travel = Estimate(1.0)
    rng = np.random.default_rng(SEED)
    there = np.concatenate([np.arange(0.0, 1.5, 0.002), np.arange(1.5, 1.25, -0.002)])
    path = sign * there + rng.normal(0.0, 2e-4, there.size)
    for rows in np.array_split(np.arange(path.size), 40):
        travel.add(path[rows] % 1.0, path[rows] % 1.0, rows * 0.01)
    one_way, other = travel.covered[:: int(sign)]
    assert one_way == 1.0
    assert other == pytest.approx(0.25, abs=2.0 / CELLS)
    assert travel.share == 1.0
    assert travel.travelled == pytest.approx(1.75, abs=0.02)
    assert travel.speeds == pytest.approx([0.2, 0.2], rel=0.2)


def test_few_positions_leave_the_orders_that_they_tell_apart():
    estimate = Estimate(360.0)
    for turn in range(4):
        angle = np.arange(72) * 5.0 + 360.0 * turn
        estimate.add(angle, angle + np.sin(3.0 * np.radians(angle)), angle / 30.0)
    assert [order.order for order in estimate.orders] == [3]
    assert estimate.orders[0].amplitude_arcsec == pytest.approx(3600.0, rel=1e-6)
