"""A model and a robot in words: their numbers are the model's, and a bound is one."""

import random
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.pattern import ARCSEC_PER_RAD, SOLVED, STEEP, Pattern
from trueangle.model.terms import ScaleError

PERIODS = (360.0, 2.0 * np.pi, 1.0)
#: Printed to four digits.
DIGITS = 6e-4


def model(period, seed=0, terms=()):
    """Orders 1 to 3 of the output and 2 of a motor, with a zero, of a hundred arcsec each."""
    rng = np.random.default_rng(seed)
    sizes = rng.normal(0.0, 100.0, (2, 4)) * period / 1_296_000.0
    shafts = [
        ta.Shaft("output", 1, [1, 2, 3], sizes[0, :3], sizes[1, :3]),
        ta.Shaft("motor", 50, [2], sizes[0, 3:], sizes[1, 3:]),
    ]
    return ta.HarmonicModel(shafts, -2e-4 * period, period, terms=terms)


@pytest.mark.parametrize("period", PERIODS)
def test_the_table_is_that_of_the_harmonics(period):
    one = model(period)
    text = one.summary()
    constant = re.search(r"constant (\S+) \S+, (\S+) arcsec", text)
    wanted = [one.constant, one.constant * 1_296_000.0 / period]
    assert [float(x) for x in constant.groups()] == pytest.approx(wanted, rel=1e-5)
    rows = re.findall(r"^(output|motor) +(\d+) +(\S+) +(\S+)$", text, re.M)
    assert [(name, int(k)) for name, k, _, _ in rows] == [
        (shaft.name, k) for shaft in one.shafts for k in shaft.orders
    ]
    arcsec = one.amplitudes * 1_296_000.0 / period
    assert [float(row[2]) for row in rows] == pytest.approx(arcsec, rel=DIGITS)
    phases = np.array([float(row[3]) for row in rows])
    assert ((phases >= 0.0) & (phases < 360.0)).all()
    np.testing.assert_allclose(phases, np.degrees(one.phases) % 360.0, atol=0.0051)
    assert (np.degrees(one.phases) < 0.0).any()


@pytest.mark.parametrize("period", PERIODS)
def test_the_most_that_is_told_of_a_joint_bounds_its_correction(period):
    """And is reached by one line: a bound of orders and zero, not more."""
    x = np.linspace(0.0, period, 20_000)
    single = ta.HarmonicModel(
        [ta.Shaft("output", 1, [1], [0.0], [1e-4 * period])], -2e-4 * period, period
    )
    moved = model(period, 3, [ta.Backlash(1e-4 * period)])
    robot = ta.Robot({"a": model(period, 1), "b": single, "c": moved})
    told = {}
    for joint, most, beside in re.findall(
        r"(\w): .* at most (\S+) arcsec( plus terms)?,", robot.summary()
    ):
        told[joint] = float(most)
        assert bool(beside) == bool(robot[joint].terms)
        error = robot[joint].replace(terms=()).error(x)
        largest = float(np.abs(error).max()) * 1_296_000.0 / period
        assert largest <= told[joint] * (1.0 + DIGITS)
    assert told.keys() == {"a", "b", "c"}
    assert told["b"] == pytest.approx(3e-4 * 1_296_000.0, rel=DIGITS)


def test_terms_that_hold_over_their_own_travel_hold_together_where_all_do():
    """Of two ramps from -100 to 500 and from 20 to 900 deg."""
    ramps = [ScaleError(1e-5, -100.0, 500.0), ScaleError(2e-5, 20.0, 900.0)]
    for terms in (ramps, ramps[::-1]):
        assert model(360.0, terms=terms).partial_span == (20.0, 500.0)


def test_a_summary_word_by_word():
    from trueangle.model.records import FitRecord

    a = 1.0 / 3600.0
    shaft = ta.Shaft("output", 1, [1, 12], [0.0, 3.0 * a], [40.0 * a, 0.0])
    record = FitRecord(1, 1, (20.0, 140.0), 0.001)
    one = ta.HarmonicModel([shaft], 0.25, 360.0, terms=(ta.Backlash(a),), fit=record)
    assert one.summary().splitlines() == [
        "HarmonicModel: 2 orders of output, period 360, argument reference, with backlash",
        "constant 0.25 deg, 900 arcsec",
        "shaft                 order  amplitude, arcsec  phase, deg",
        "output                    1              40.00        0.00",
        "output                   12              3.000       90.00",
        "fitted to 1 reading of 1 run between 20 and 140 deg",
    ]
    several = one.replace(fit=FitRecord(80, 2, (20.0, 140.0), 0.001), terms=())
    assert several.summary().splitlines()[-1] == (
        "fitted to 80 readings of 2 runs between 20 and 140 deg"
    )


@pytest.mark.parametrize("more", [-1, 0, 1, 30])
def test_a_summary_lists_as_many_orders_as_a_screen_holds(more):
    from trueangle.model.model import _LISTED

    count = _LISTED + more
    shaft = ta.Shaft("output", 1, list(range(1, count + 1)), [1e-4] * count, [0.0] * count)
    lines = ta.HarmonicModel([shaft], 0.0, 360.0).summary().splitlines()
    listed = [line for line in lines if line.startswith("output")]
    assert len(listed) == min(count, _LISTED)
    assert (f"... and {more} more" in lines) is (more > 0)
    assert (" more" in lines[-1]) is (more > 0)


@pytest.mark.parametrize("condition", [0.5, 0.999, -1.0, np.nan])
def test_a_condition_number_is_one_or_more_but_for_its_rounding(condition):
    assert model(360.0).replace(condition_number=1.0 - 1e-9).condition_number < 1.0
    with pytest.raises(ta.errors.ArgumentError, match="condition_number must be a finite number"):
        model(360.0).replace(condition_number=condition)


@pytest.mark.parametrize("count", [1, 4, 5, 9])
def test_the_first_line_names_four_shafts_and_counts_the_others(count):
    shafts = [ta.Shaft(f"s{k}", k, [1], [1e-4], [0.0]) for k in range(1, count + 1)]
    told = repr(ta.HarmonicModel(shafts, 0.0, 360.0))
    named = ", ".join(f"s{k}" for k in range(1, min(count, 4) + 1))
    more = f" and {count - 4} more" if count > 4 else ""
    assert f" of {named}{more}, period 360" in told


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
