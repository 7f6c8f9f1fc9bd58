"""The periodic error as a function of the angle: its slope, and its value where it is indicated."""

import random

import numpy as np
import pytest

from trueangle.joint.pattern import ARCSEC_PER_RAD, SOLVED, STEEP, Pattern

#: Of a central difference over H: its third derivative and the rounding of two values.
H, DIFFERENCE = 1e-5, 1e-7
#: Doubles of some hundred arcsec.
ROUNDING = 1e-12


def drawn(rng, steepest):
    """Lines of orders up to 200, whole and not, of this slope at most."""
    orders = np.concatenate([rng.integers(1, 200, 6).astype(float), rng.uniform(0.3, 9.0, 2)])
    cosine, sine = rng.normal(size=(2, orders.size)) / orders
    scale = steepest * ARCSEC_PER_RAD / float(orders @ np.hypot(cosine, sine))
    return Pattern(orders, scale * cosine, scale * sine)


@pytest.fixture
def rng():
    seed = random.SystemRandom().randrange(2**32)
    print("seed", seed)
    return np.random.default_rng(seed)


def test_the_slope_is_that_of_the_value(rng):
    pattern = drawn(rng, 0.02)
    theta = rng.uniform(-30.0, 30.0, 1003)  # no whole number of vectors
    value, slope = pattern.value_and_slope(theta)
    np.testing.assert_array_equal(value, pattern.value(theta))
    difference = (pattern.value(theta + H) - pattern.value(theta - H)) / (2.0 * H * ARCSEC_PER_RAD)
    np.testing.assert_allclose(slope, difference, rtol=0.0, atol=DIFFERENCE)
    assert np.abs(slope).max() > 1000.0 * DIFFERENCE


def test_angles_keep_their_shape(rng):
    pattern = drawn(rng, 0.01)
    theta = rng.uniform(0.0, 6.0, (3, 5))
    value, slope = pattern.value_and_slope(theta)
    assert value.shape == slope.shape == pattern.value(theta).shape == theta.shape
    assert pattern.indicated_value(theta).shape == theta.shape


@pytest.mark.parametrize("steepest", [1e-6, 1e-3, 0.05, 0.5, 0.95 * STEEP])
def test_the_indicated_value_solves_its_equation(steepest, rng):
    pattern = drawn(rng, steepest)
    theta = rng.uniform(0.0, 2.0 * np.pi, 501)
    error = pattern.indicated_value(theta)
    left = error - pattern.value(theta + error / ARCSEC_PER_RAD)
    size = float(np.abs(error).max())
    assert np.abs(left).max() < SOLVED + ROUNDING * size
    # By the definition, put in until nothing changes.
    again = pattern.value(theta)
    for _ in range(400):
        again = pattern.value(theta + again / ARCSEC_PER_RAD)
    np.testing.assert_allclose(
        error, again, rtol=0.0, atol=2.0 * SOLVED / (1.0 - steepest) + 100.0 * ROUNDING * size
    )
