"""A correction below its own standard error is none; the curve decides, not one coefficient."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, NoModelError
from trueangle.fitting.worth import of_worth

SEED = 88_200


def refused(amplitude: float, seed: int, stop: float = 360.0, ridge: float | None = None) -> bool:
    rng = np.random.default_rng([SEED, seed])
    x = np.linspace(0.0, stop, 120, endpoint=False)
    error = amplitude * np.sin(np.radians(x + 30.0)) + rng.normal(0.0, 0.01, x.size)
    fit = ta.fit(ta.CalibrationRun(x, x + error, 360.0), orders=[1, 2, 3], ridge=ridge)
    if stop < 360.0:  # a coefficient is hardly known, the curve is
        assert (fit.amplitude_std > 0.3 * fit.amplitudes).any()
    try:
        of_worth(fit)
    except NoModelError:
        return True
    return False


def test_noise_is_no_correction_and_a_curve_is():
    """Three orders of noise: rarely is each amplitude below its own error."""
    print("seed", SEED)
    assert 0.01 < np.mean([refused(0.0, k) for k in range(200)]) < 0.2
    assert not any(refused(0.01, k) for k in range(50))
    assert not any(refused(0.2, k, 110.0, 0.0) for k in range(20))


def levels(seed: int, scale: float) -> ta.CalibrationRun:
    """A servo sent to three angles: 401 readings, most of them at rest, some on the way."""
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(401)
    target = rng.uniform(0.0, 180.0, 3)[np.minimum(time // 2.7, 2).astype(int)]
    indicated = np.empty(time.size)
    indicated[0] = target[0] - 8.0
    for k in range(1, time.size):
        goal = 85.0 + scale * (target[k] - 90.0) + 3.0 * np.sin(np.radians(target[k]))
        indicated[k] = indicated[k - 1] + np.clip(goal - indicated[k - 1], -2.5, 2.5)
    return ta.CalibrationRun(target, indicated + rng.normal(0.0, 0.1, time.size), 360.0, time)


def test_three_levels_of_a_servo_make_no_model_but_of_declared_orders():
    run = levels(1, 1.0)
    with pytest.raises(NoModelError, match=r"own standard error of|several true angles"):
        ta.fit(run)
    assert ta.fit(run, orders=[1]).model.orders == (1.0,)


@pytest.mark.parametrize("scale", [0.7, 1.4])
def test_a_fit_refuses_what_a_check_refuses_and_names_the_remedy(scale):
    run = levels(11, scale)
    (fault,) = [fault for fault in ta.check(run).data_faults if fault.unusable]
    for orders in (None, [1]):
        with pytest.raises(ArgumentError, match=re.escape(str(fault))):
            ta.fit(run, orders=orders)
    (number,) = re.match(r"divide the indicated angle by (\S+), or", fault.mend).groups()
    divided = ta.CalibrationRun(run.reference, run.indicated / float(number), 360.0, run.time)
    assert ta.check(divided).usable
    assert ta.fit(divided, orders=[1]).model.orders == (1.0,)


@pytest.mark.parametrize(("middle", "amplitude"), [(0.0, 20.0), (180.0, 25.0), (0.0, 12.0)])
def test_an_error_that_is_large_over_part_of_a_turn_is_no_gear(middle, amplitude):
    """A compass over 142 deg: its error has a slope of its own, and bends."""
    x = middle + np.linspace(-71.0, 71.0, 400)
    error = amplitude * np.sin(np.radians(x)) + np.random.default_rng(SEED).normal(0.0, 0.5, 400)
    run = ta.CalibrationRun(x, x + error, 360.0)
    found = ta.check(run)
    assert found.usable
    assert abs(found.ratio - 1.0) > 0.15
    assert found.suggests == "no straight line: an error of the joint over this travel"
    assert ta.fit(run, orders=[1]).amplitudes == pytest.approx([amplitude], rel=0.05)
