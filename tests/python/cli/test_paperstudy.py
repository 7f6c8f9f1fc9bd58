"""The study of the paper: what is held out takes no part, and what is told is of it."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli.paperstudy.study import JOINT_A, JOINT_B, reduction, simulated_groups

ORDERS = {"a": (1, 4, 8, 12, 14, 15, 16), "b": (1, 4, 7, 8, 12, 14, 16)}


def disturbed(run, size):
    """The same run with readings off by as much, in an order that is fitted."""
    error = size / 3600.0 * np.sin(np.radians(8.0 * run.reference))
    return ta.CalibrationRun(run.reference, run.indicated + error, 360.0, mount=run.mount)


@pytest.mark.parametrize("joint", [JOINT_A, JOINT_B], ids=["a", "b"])
@pytest.mark.parametrize("apart", [False, True])
def test_what_the_held_run_says_moves_no_coefficient(joint, apart):
    """The last run, or one given beside all: between the positions the rest is the same."""
    orders = ORDERS[joint.name]
    *groups, last = simulated_groups(joint, seed=5)
    found = []
    for size in (0.0, 100.0):
        held = disturbed(last, size)
        runs, given = (groups, held) if apart else ([*groups, held], None)
        found.append(reduction(joint, runs, orders, given))
    plain, moved = found
    assert moved.dense == plain.dense
    assert moved.dense_rms == plain.dense_rms
    assert moved.positions[1] > plain.positions[1] + 100.0
    assert plain.in_between < -80.0


@pytest.mark.parametrize("joint", [JOINT_A, JOINT_B], ids=["a", "b"])
def test_without_noise_nothing_is_left(joint):
    """Every line is fitted: of the error at the positions and between them all is gone."""
    runs = simulated_groups(joint, noise=0.0)
    found = reduction(joint, runs, ORDERS[joint.name])
    grid = joint.error(np.arange(0.0, 360.0, 0.05))
    assert found.dense[0] == pytest.approx(np.ptp(grid))
    assert found.dense_rms[0] == pytest.approx(np.std(grid))
    assert found.positions[0] == pytest.approx(np.ptp(joint.error(10.0 * np.arange(36))))
    assert max(found.positions[1], found.dense[1], found.dense_rms[1]) < 1e-6
    assert (found.at_positions, found.in_between) == pytest.approx((-100.0, -100.0))
