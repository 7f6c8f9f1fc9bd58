"""Orders of one run hold for its later stretches, or no correction is given."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import NoModelError
from trueangle.fitting.problem import Problem
from trueangle.fitting.transfer import (
    check_later_segment,
    check_new_run,
    gains_of_runs,
    gains_of_segments,
)
from trueangle.joint.shafts import resolve_orders

SEED = 20261


def run_of(x, error, noise=0.002, seed=0):
    rng = np.random.default_rng([SEED, seed])
    return ta.CalibrationRun(x, x + error + noise * rng.normal(size=x.size), 360.0)


def there_and_back(arc, passes=4, n=300):
    there = np.linspace(20.0, 20.0 + arc, n)
    return np.concatenate([there if i % 2 == 0 else there[::-1] for i in range(passes)])


def gains(run, orders):
    problem = Problem([run], resolve_orders(orders), "reference")
    return gains_of_segments(problem, problem.base)


def test_gains_are_those_of_refits():
    x = there_and_back(350.0)
    run = run_of(x, 0.1 * np.sin(np.radians(x)) + 0.05 * np.cos(np.radians(3 * x)))
    found = gains(run, [1, 3])
    quarters = np.array_split(np.arange(x.size), 4)
    for gain, held in zip(found, quarters, strict=True):
        rest = np.delete(np.arange(x.size), held)
        kept = ta.CalibrationRun(x[rest], run.indicated[rest], 360.0)
        model = ta.fit(kept, [1, 3], loss="linear", ridge=0.0).model
        error = (run.indicated - run.reference)[held]
        assert gain == pytest.approx(error.var() - (error - model.error(x[held])).var(), rel=1e-9)


@pytest.mark.parametrize("arc", [190.0, 330.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_pattern_that_repeats_is_corrected(arc, seed):
    x = there_and_back(arc)
    error = 0.1 * np.sin(np.radians(x) + seed) + 0.02 * np.sin(np.radians(4 * x))
    assert ta.fit(run_of(x, error, seed=seed)).model.orders


@pytest.mark.parametrize("seed", range(3))
def test_an_error_that_changes_from_pass_to_pass_is_refused(seed):
    """The pattern of the first passes is turned over in the last."""
    x = there_and_back(190.0, passes=6)
    turned = np.where(np.arange(x.size) < 1100, 1.0, -1.0)
    error = turned * 0.1 * np.sin(np.radians(2 * x) + seed)
    run = run_of(x, error, noise=0.02, seed=seed)
    with pytest.raises(NoModelError, match=r"segments of it larger|no order is supported"):
        ta.fit(run)
    assert ta.fit(run, [2]).orders == (2,)


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_on_a_short_travel_is_no_order(seed):
    """Half an hour of a telescope: 9 deg, an undeclared worm, a drift."""
    rng = np.random.default_rng([SEED, seed])
    x = np.linspace(0.0, 9.0, 600)
    t = x / 9.0 - 0.5
    drift = 0.01 * (rng.normal() * t + rng.normal() * t**2 + rng.normal() * t**3)
    run = run_of(x, 0.0025 * np.sin(np.radians(144 * x)) + drift, noise=5e-4, seed=seed)
    with pytest.raises(NoModelError, match="declare the orders"):
        ta.fit(run)
    assert ta.fit(run, [144]).orders == (144,)


def test_places_passed_once_say_nothing():
    x = np.linspace(0.0, 300.0, 400)
    run = run_of(x, 0.1 * np.sin(np.radians(x)))
    assert gains(run, [1]) is None
    assert gains(run_of(x[:20], 0.0 * x[:20]), [1]) is None


@pytest.mark.parametrize("count", [3, 5])
def test_orders_on_which_unlike_joints_agree_by_chance_are_refused(count):
    """Each shows ten orders of its own; order 4 is the same in these few."""
    runs = []
    for i in range(count):
        rng = np.random.default_rng([SEED, i])
        x = np.sort(rng.uniform(0.0, 360.0, 2000))
        own = sum(
            0.3 / k * np.sin(np.radians(k * x) + rng.uniform(0.0, 2 * np.pi))
            for k in range(1, 11)
            if k != 4
        )
        size = 0.05 * (1.0 + 0.3 * i)
        runs.append(run_of(x, own + size * np.sin(np.radians(4 * x)), seed=i))
    found = gains_of_runs(runs, [4.0], "reference")
    assert found.shared < 0.5 * found.shown
    why = r"share nothing may by chance|different joints|no order"
    with pytest.raises(NoModelError, match=why):
        ta.fit(runs, argument="reference")
    # Told: by how much the mean of the others' order 4 lessens each, of all that each shows.
    sizes = 0.05 * (1.0 + 0.3 * np.arange(count))
    others = (sizes.sum() - sizes) / (count - 1)
    gain = np.mean(sizes**2 - (sizes - others) ** 2)
    every = sum((0.3 / k) ** 2 for k in range(1, 11) if k != 4) + np.mean(sizes**2)
    with pytest.raises(NoModelError) as told:
        check_new_run(runs, resolve_orders([4]), "reference")
    (percent,) = re.findall(r"they share (\S+) % \(order 4\), no more than", str(told.value))
    assert float(percent) == pytest.approx(100.0 * gain / every, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_runs_of_one_joint_whose_lines_vary_are_not_unlike(seed):
    """By a fifth from run to run: few orders are sure of three runs, but not by chance."""
    rng = np.random.default_rng([SEED, seed])
    phases, sizes = rng.uniform(0.0, 6.28, 4), 0.1 * rng.uniform(0.2, 1.0, 4)
    runs = []
    for i in range(3):
        x = np.sort(rng.uniform(0.0, 360.0, 300))
        lines = zip((1, 2, 4, 6), phases, sizes, strict=True)
        error = sum(
            c / k * (1.0 + 0.2 * rng.normal()) * np.sin(np.radians(k * x) + p) for k, p, c in lines
        )
        runs.append(run_of(x, error, noise=0.005, seed=i))
    found = gains_of_runs(runs, [1.0, 2.0, 4.0, 6.0], "reference")
    assert found.shared > 0.5 * found.shown


@pytest.mark.filterwarnings("ignore::trueangle.errors.UnlikeRunsWarning")
def test_a_drift_that_would_stand_for_the_pattern_is_left():
    """One turn a run at one speed, and order 1 of another size in each: a spline in time fits."""
    runs = []
    for i in range(8):
        x = np.linspace(0.0, 359.0, 720)
        size = 0.1 * (1.0 + i)
        error = size * np.sin(np.radians(x) + i) + 0.1 * np.sin(np.radians(4 * x))
        one = run_of(x, error, seed=i)
        runs.append(ta.CalibrationRun(x, one.indicated, 360.0, time=x / 360.0))
    found = ta.fit(runs, [1, 4], nuisance="auto")
    assert "drift" not in found.nuisance.kinds
    assert "drift" in found.nuisance.unseparated
    assert found.model.amplitudes.max() < 0.9  # the greatest of a run


def test_a_refusal_counts_those_that_would_be_made_worse():
    """One run of four is turned over, and one quarter of a run: by the gains of each."""
    x = np.linspace(0.0, 360.0, 400, endpoint=False)
    signs = (1.0, 1.0, 1.0, -1.0)
    errors = [0.1 * sign * np.sin(np.radians(2.0 * x)) for sign in signs]
    runs = [run_of(x, error, seed=seed) for seed, error in enumerate(errors)]
    wanted = resolve_orders([2])
    told = gains_of_runs(runs, [2.0], "reference").gains
    assert (told < 0.0).tolist() == [False, False, False, True]
    with pytest.raises(NoModelError, match=r"order 2 would make the error of 1 of 4 runs larger"):
        check_new_run(runs, wanted, "reference")
    passes = np.concatenate([x, x[::-1], x, x[::-1]])
    whole = run_of(
        passes, np.concatenate([errors[0], errors[0][::-1], errors[0], -errors[0][::-1]])
    )
    assert (gains(whole, [2]) < 0.0).tolist() == [False, False, False, True]
    problem = Problem([whole], wanted, "reference")
    with pytest.raises(NoModelError, match=r"order 2 would make the error of 1 of 4 segments of"):
        check_later_segment(problem, problem.base)
