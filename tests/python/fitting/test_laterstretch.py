"""Orders of one run hold for its later stretches, or no correction is given."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import NoModelError

SEED = 20261


def run_of(x, error, noise=0.002, seed=0):
    rng = np.random.default_rng([SEED, seed])
    return ta.CalibrationRun(x, x + error + noise * rng.normal(size=x.size), 360.0)


def there_and_back(arc, passes=4, n=300):
    there = np.linspace(20.0, 20.0 + arc, n)
    return np.concatenate([there if i % 2 == 0 else there[::-1] for i in range(passes)])


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
    with pytest.raises(NoModelError, match="no model: "):
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
    with pytest.raises(NoModelError, match="fit the orders that you know"):
        ta.fit(run)
    assert ta.fit(run, [144]).orders == (144,)


@pytest.mark.parametrize("count", [3, 5])
def test_of_unlike_joints_the_order_that_they_share_is_fitted(count):
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
    found = ta.fit(runs, argument="reference")
    # What differs from run to run is all that the others are, but for some that agree by chance.
    assert 4 in found.orders
    assert len(found.orders) <= 3
    row = found.selection.row(4)
    sizes = 0.05 * (1.0 + 0.3 * np.arange(count))
    assert row.amplitude == pytest.approx(sizes.mean(), abs=3.0 * row.standard_error)


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
