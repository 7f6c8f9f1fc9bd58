"""The paper's method and study against its figures and against the tabulated consequence."""

import re
import subprocess
import sys

import numpy as np
import pytest

import trueangle as ta
from conftest import ROOT
from trueangle.cli.demo import (
    GEAR_ORDERS,
    JOINT_A,
    JOINT_B,
    PUBLISHED,
    lifted,
    paper_study,
    reduction,
    short_report,
    simulated_groups,
)
from trueangle.errors import ArgumentError
from trueangle.fitting.orders.paper import select_by_paper

GRID = np.arange(36) * 10.0


def test_equations_8_and_9():
    # Peak-to-peak in arcsec at the positions and on a dense grid, printed to two digits.
    dense = np.arange(0.0, 360.0, 0.01)
    for joint, at, between in ((JOINT_A, 143.59, 149.45), (JOINT_B, 101.33, 107.06)):
        assert np.ptp(joint.error(GRID)) == pytest.approx(at, abs=0.006)
        assert np.ptp(joint.error(dense)) == pytest.approx(between, abs=0.006)
    assert JOINT_A.error(0.0) == pytest.approx(-1.8, abs=0.05)
    assert JOINT_B.error(0.0) == pytest.approx(3.1, abs=0.05)


@pytest.mark.parametrize("joint", [JOINT_A, JOINT_B])
def test_lifted_joints_are_the_same_at_the_positions(joint):
    high = lifted(joint)
    assert set(high.lines) == {GEAR_ORDERS.get(k, k) for k in joint.lines}
    # Rounding of 400 * 2 pi times 33 arcsec.
    np.testing.assert_allclose(high.error(GRID), joint.error(GRID), atol=1e-9)


# Mean of 40 simulated studies, arcsec: positions, everywhere (peak-to-peak), rms after.
CASES = [
    (JOINT_A, {}, 5.2, (144, 22.8), (149, 6.6), None),
    (JOINT_A, {14: 202, 16: 200}, 5.2, (144, 23.5), (167, 211), None),
    (JOINT_A, {8: 100, 14: 202, 16: 200}, 5.2, (143, 22.9), (187, 257), None),
    (JOINT_A, None, 5.2, (143, 23.3), (162, 272), 44.7),
    (JOINT_B, {14: 202, 16: 200}, 3.6, (102, 15.8), (111, 105), None),
    (JOINT_B, None, 3.6, (102, 16.0), (120, 165), 27.0),
]


@pytest.mark.parametrize(("joint", "orders", "noise", "positions", "dense", "rms"), CASES)
def test_consequence_of_gear_orders_behind_the_aliases(joint, orders, noise, positions, dense, rms):
    true = lifted(joint, orders)
    found = [
        reduction(true, simulated_groups(true, noise=noise, seed=s), sorted(joint.lines))
        for s in range(40)
    ]
    # The range of 36 readings has a relative standard deviation of 16 %: 3 % for 40 means.
    assert np.mean([r.positions for r in found], axis=0) == pytest.approx(positions, rel=0.07)
    assert np.mean([r.dense for r in found], axis=0) == pytest.approx(dense, rel=0.03)
    if rms is not None:
        assert np.mean([r.dense_rms[1] for r in found]) == pytest.approx(rms, rel=0.01)


def test_the_study_reproduces_the_papers_figures():
    for joint in (JOINT_A, JOINT_B):
        found = [
            reduction(joint, simulated_groups(joint, seed=s), sorted(joint.lines))
            for s in range(60)
        ]
        first, last, share = PUBLISHED[joint.name]
        before, after = np.mean([r.positions for r in found], axis=0)
        # One published run against the mean of many: 5 and 16 % of scatter.
        assert before == pytest.approx(first, rel=0.06)
        assert after == pytest.approx(last, rel=0.06)
        assert -np.mean([r.at_positions for r in found]) == pytest.approx(share, abs=1.5)


def test_the_papers_method_retains_its_orders():
    study = paper_study()
    assert study.selections["a"].orders == (1, 4, 8, 12, 14, 15, 16)
    assert study.selections["b"].orders == (1, 4, 7, 8, 12, 14, 16)
    assert {202, 22, 50} <= set(study.selections["a"].row(14).aliases)
    assert study.planned["a"].orders == (1, 100, 200, 201, 202, 300, 400)
    assert study.planned["b"].orders == (1, 100, 101, 200, 202, 300, 400)
    for name in ("a", "b"):
        assert study.gear[name].at_positions < -75.0
        assert study.gear[name].in_between > 30.0
        assert study.planned[name].in_between < -94.0
    assert len(short_report(study).splitlines()) == 11


def test_phases_across_the_turn_are_averaged_on_the_circle():
    # Phases around 0/360: the arithmetic mean would be near 180 and reverse the model.
    random = np.random.default_rng(0)
    runs = []
    for phase in (355.0, 5.0, 358.0, 2.0, 0.0, 359.0):
        error = 20.0 * np.sin(np.radians(3 * GRID + phase)) + random.normal(0.0, 0.5, 36)
        runs.append(ta.CalibrationRun(GRID, GRID + error / 3600.0, period=360.0))
    chosen = ta.select_orders(runs, method="paper")
    assert chosen.orders == (3,)
    row = chosen.row(3)
    assert abs(row.phase_deg) < 3.0
    assert row.phase_spread_deg == pytest.approx(10.0, abs=4.0)
    assert row.amplitude * 3600 == pytest.approx(20.0, abs=0.5)


def test_the_papers_method_needs_three_runs():
    runs = simulated_groups(JOINT_A)[:2]
    with pytest.raises(ArgumentError, match="three or more"):
        ta.select_orders(runs, method="paper")
    with pytest.raises(ArgumentError, match="one of evidence, paper, got 'eye'"):
        ta.select_orders(runs, method="eye")


def test_what_was_put_right_is_said():
    text = select_by_paper.__doc__
    for word in ("N = 37", "intercept", "atan2", "on\n      the circle", "peak-to-peak"):
        assert word in text


def test_the_example_runs():
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "paper" / "study.py")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.search(r"  a .* 149.53 -> 26.62 +82.20 % ", done.stdout)
    assert re.search(r"a all are gear orders .*\( \+\d\d %\)", done.stdout)
    assert "three mounts at 0, 2.14, 4.28 deg" in done.stdout


def disturbed(run, size):
    """The same run with readings off by as much, in an order that is fitted."""
    error = size / 3600.0 * np.sin(np.radians(8.0 * run.reference))
    return ta.CalibrationRun(run.reference, run.indicated + error, 360.0, mount=run.mount)


@pytest.mark.parametrize("joint", [JOINT_A, JOINT_B], ids=["a", "b"])
@pytest.mark.parametrize("apart", [False, True])
def test_what_the_held_run_says_moves_no_coefficient(joint, apart):
    """The last run, or one given beside all: between the positions the rest is the same."""
    orders = sorted(joint.lines)
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
    found = reduction(joint, runs, sorted(joint.lines))
    grid = joint.error(np.arange(0.0, 360.0, 0.05))
    assert found.dense[0] == pytest.approx(np.ptp(grid))
    assert found.dense_rms[0] == pytest.approx(np.std(grid))
    assert found.positions[0] == pytest.approx(np.ptp(joint.error(10.0 * np.arange(36))))
    assert max(found.positions[1], found.dense[1], found.dense_rms[1]) < 1e-6
    assert (found.at_positions, found.in_between) == pytest.approx((-100.0, -100.0))
