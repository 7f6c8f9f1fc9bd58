"""A frequency that differs from run to run: bands of trial frequencies, written out."""

import numpy as np
import pytest

from trueangle.effects.time_periodic import FREQUENCY_DRIFT, OVERSAMPLING, _drifting

SEED = 29
RUNS = 5
#: Trial frequencies from 1 to 9 Hz, so dense that a band holds some dozen.
FREQUENCIES = np.arange(1.0, 9.0, 0.002)


@pytest.mark.parametrize("middle", [1.3, 4.0, 8.6])
def test_the_greatest_powers_within_a_band_are_added_up(middle):
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    power = rng.uniform(0.0, 0.5, (FREQUENCIES.size, RUNS))
    places = np.searchsorted(
        FREQUENCIES, middle * (1.0 + FREQUENCY_DRIFT * rng.uniform(-0.4, 0.4, RUNS))
    )
    heights = rng.uniform(40.0, 60.0, RUNS)
    power[places, np.arange(RUNS)] = heights
    found, deviance, log_grid = _drifting(FREQUENCIES, power)
    np.testing.assert_array_equal(found, places)
    assert deviance == pytest.approx(heights.sum())
    # As many bands as are apart, and in each the cells of every run.
    bands = np.log(FREQUENCIES[-1] / FREQUENCIES[0]) / FREQUENCY_DRIFT
    cells = 2.0 * FREQUENCY_DRIFT * middle / 0.002 / OVERSAMPLING
    assert log_grid == pytest.approx(np.log(2.0 * bands) + RUNS * np.log(cells + 1.0), abs=0.2)


def test_a_frequency_further_off_than_it_may_wander_is_not_taken():
    power = np.zeros((FREQUENCIES.size, 2))
    one, other = np.searchsorted(FREQUENCIES, (3.0, 3.0 * (1.0 + 5.0 * FREQUENCY_DRIFT)))
    power[one, 0], power[other, 1] = 50.0, 40.0
    _, deviance, _ = _drifting(FREQUENCIES, power)
    assert deviance == pytest.approx(50.0)


def test_trials_too_far_apart_hold_no_band():
    found, deviance, log_grid = _drifting(np.arange(1.0, 3.0, 0.5), np.ones((4, 2)))
    assert (found.tolist(), deviance, log_grid) == ([0, 0], -np.inf, 0.0)
