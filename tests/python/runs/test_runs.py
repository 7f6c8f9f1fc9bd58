"""CalibrationRun: what it checks and what it derives."""

import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.runs.run import as_runs

THETA = np.arange(0.0, 360.0, 10.0)


@pytest.mark.parametrize("period", [1.0, 360.0, 2.0 * math.pi])
def test_wrapped_angles_differ_by_whole_turns_and_lie_in_one(period):
    """Against exact fractions; at half a turn, which is kept, and one bit beside it."""
    half = 0.5 * period
    beside = [np.nextafter(half, 0.0), half, np.nextafter(half, period)]
    rng = np.random.default_rng(11)
    angles = np.concatenate([beside, np.negative(beside), rng.uniform(-9.0, 9.0, 500) * period])
    for angle, wrapped in zip(angles.tolist(), ta.wrap(angles, period).tolist(), strict=True):
        assert -half < wrapped <= half
        turns = (Fraction(angle) - Fraction(wrapped)) / Fraction(period)
        # One rounding of the turns taken off, one of the difference.
        assert abs(turns - round(turns)) <= 2 * abs(angle / period) * 2.0**-53 + 2.0**-53
    kept = beside[:2]
    assert ta.wrap(kept, period).tolist() == kept


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference": []}, "empty"),
        ({"reference": [[1.0]]}, "one-dimensional"),
        ({"indicated": THETA[:-1]}, "indicated has 35 readings, reference has 36"),
        ({"indicated": np.where(THETA == 50.0, np.nan, THETA)}, r"indicated\[5\] is nan"),
        ({"reference": np.where(THETA == 50.0, np.inf, THETA)}, r"reference\[5\] is inf"),
        ({"reference": ["a"] * 36}, "reference must be numbers"),
        ({"period": -360.0}, "period"),
        ({"time": -THETA}, r"time must not decrease.*time\[1\] = -10 after"),
        ({"temperature": [1.0, 2.0]}, "temperature has 2"),
        ({"weights": np.where(THETA == 50.0, -1.0, 1.0)}, r"weights\[5\]"),
        # The first of several.
        ({"weights": np.where(THETA < 50.0, 1.0, -THETA)}, r"weights\[5\] .* got -50"),
        ({"time": np.abs(THETA - 50.0)}, r"time\[1\] = 40 after 50"),
        ({"reference": np.where(THETA < 50.0, THETA, np.inf)}, r"reference\[5\] is inf"),
    ],
)
def test_bad_arguments_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        ta.CalibrationRun(**({"reference": THETA, "indicated": THETA, "period": 360.0} | change))


def test_a_scalar_stands_for_every_reading():
    run = ta.CalibrationRun(THETA, THETA, period=360.0, temperature=21.5, mount=130.0)
    assert run.temperature.shape == (36,)
    assert run.mount[7] == 130.0


def test_arrays_are_copies_that_cannot_be_written():
    theta = THETA.copy()
    run = ta.CalibrationRun(theta, theta, period=360.0)
    theta[0] = 99.0
    assert run.reference[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        run.reference[0] = 1.0


def test_pickle_keeps_everything():
    run = ta.CalibrationRun(
        THETA, THETA, 360.0, time=THETA, label="a", velocity=THETA, columns={"x": THETA}
    )
    again = pickle.loads(pickle.dumps(run))
    assert again.label == "a"
    np.testing.assert_array_equal(again.velocity, THETA)
    np.testing.assert_array_equal(again.columns["x"], THETA)


@pytest.mark.parametrize("zero", [-109.4, 0.0, 179.999, 180.0, 1234.5])
def test_centred_error_never_jumps(zero):
    error = 3.0 * np.sin(np.radians(THETA))
    run = ta.CalibrationRun(THETA, np.mod(THETA + zero + error, 360.0), period=360.0)
    centred = run.centred_error
    np.testing.assert_allclose(centred - centred.mean(), error - error.mean(), atol=1e-12)
    assert math.remainder(run.zero - zero, 360.0) == pytest.approx(0.0, abs=1e-9)


def test_direction_and_speed_follow_the_unwrapped_reference():
    time = np.arange(9) * 0.5
    reference = np.array([350, 355, 0, 5, 10, 10, 5, 0, 355.0])
    run = ta.CalibrationRun(reference, reference, 360.0, time=time)
    np.testing.assert_array_equal(run.direction, [1, 1, 1, 1, 1, 1, -1, -1, -1])
    np.testing.assert_allclose(run.speed[1:4], 10.0)
    np.testing.assert_allclose(run.speed[-1], -10.0)
    assert ta.CalibrationRun(reference, reference, 360.0).speed is None


def test_equal_time_stamps_do_not_make_infinite_speeds():
    time = np.array([0.0, 0.0, 1.0, 1.0, 2.0])
    run = ta.CalibrationRun([0, 1, 10, 11, 20.0], [0, 1, 10, 11, 20.0], 360.0, time=time)
    np.testing.assert_allclose(run.speed, [10, 10, 9.75, 9.75, 9.5])


def test_a_given_velocity_wins():
    run = ta.CalibrationRun(THETA, THETA, 360.0, velocity=np.full(36, -4.0))
    np.testing.assert_array_equal(run.direction, -1.0)


def test_runs_of_two_units_are_refused():
    one = ta.CalibrationRun(THETA, THETA, period=360.0)
    other = ta.CalibrationRun(THETA, THETA, period=1.0)
    with pytest.raises(ArgumentError, match="different units"):
        as_runs([one, other])
    with pytest.raises(ArgumentError, match="at least one"):
        as_runs([])
    with pytest.raises(ArgumentError, match=r"runs\[0\].*str"):
        as_runs("joint.csv")


def test_further_signals_are_of_one_container():
    run = ta.CalibrationRun(
        THETA,
        THETA,
        period=360.0,
        torque=1.5,
        signals={"current": -0.5, "head2": THETA + 1.0, "head1": THETA, "direction": -1.0},
        unit="arm 3",
    )
    np.testing.assert_array_equal(run.signal("current"), np.full(len(run), -0.5))
    np.testing.assert_array_equal(run.signal("torque"), run.torque)
    assert list(run.heads) == ["head1", "head2"]
    assert run.signal("shift") is None
    assert (run.direction == -1.0).all()
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.signal("head2"), THETA + 1.0)
    assert again.unit == "arm 3"


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ({"curent": 1.0}, "did you mean current"),
        ({"torque": 1.0}, "separate argument"),
        ({"head0": 1.0}, "no signal"),
        ({"current": [1.0, 2.0]}, r"signals\['current'\] has 2"),
        ({"current": np.nan}, "must be finite"),
        ([1.0], "must be a mapping"),
    ],
)
def test_signals_that_are_none(signals, message):
    with pytest.raises(ArgumentError, match=message):
        ta.CalibrationRun(THETA, THETA, period=360.0, signals=signals)


def test_readings_before_the_first_motion_belong_to_it():
    reference = [350.0, 350.0, 345.0, 345.0, 350.0]
    run = ta.CalibrationRun(reference, reference, 360.0)
    np.testing.assert_array_equal(run.direction, [-1, -1, -1, -1, 1])
    still = ta.CalibrationRun([5.0, 5.0], [5.0, 5.0], 360.0, time=[0.0, 2.0])
    np.testing.assert_array_equal(still.direction, [0, 0])
    moved = ta.CalibrationRun([5.0, 15.0], [5.0, 15.0], 360.0, time=[0.0, 2.0])
    np.testing.assert_array_equal(moved.speed, [5.0, 5.0])


@pytest.mark.parametrize("zero", [100.0, -179.9, 0.0])
def test_a_centred_error_is_the_error_but_for_whole_turns(zero):
    run = ta.CalibrationRun(THETA, np.mod(THETA + zero + np.sin(THETA), 360.0), period=360.0)
    turns = (run.centred_error - run.error) / 360.0
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert abs(run.centred_error - run.zero).max() < 2.0


def test_heads_stand_in_the_order_of_their_numbers():
    names = {f"head{k}": THETA + k for k in (10, 2, 1)}
    run = ta.CalibrationRun(THETA, THETA, period=360.0, signals=names)
    assert list(run.heads) == ["head1", "head2", "head10"]
