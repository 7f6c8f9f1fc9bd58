"""Fitting: against numpy, its uncertainties, and what must not change the model."""

import copy
import math
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import trueangle as ta
from trueangle import errors
from trueangle.estimation import reference
from trueangle.fitting.heldout import hold_out

# Two backward-stable solutions of the same well-conditioned problem.
AGREE = 1e-12
# Coefficients after the same readings were written in another way (unit, zero, turns):
# rounding of angles of up to some turns, against amplitudes of a thousandth of a turn.
REWRITTEN = 1e-9

ORDERS = (1, 2, 5, 9)


def readings(seed, n=72, noise=1e-3, period=360.0):
    """Jittered angles and an error of other orders than are fitted, plus noise."""
    rng = np.random.default_rng(seed)
    theta = (np.arange(n) + rng.uniform(0, 0.9, n)) * period / n
    x = theta * 2 * np.pi / period
    error = 0.3 * np.exp(np.cos(x - 1.0)) / 3 + 0.1 * np.sin(5 * x) + noise * rng.normal(size=n)
    return theta, error * period / 360.0


def coefficients(model):
    parts = [np.column_stack([s.cosine, s.sine]).ravel() for s in model.shafts]
    return np.concatenate(parts)


def fitted(theta, indicated, period=360.0, orders=ORDERS, **options):
    return ta.fit(ta.CalibrationRun(theta, indicated, period=period), orders=orders, **options)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_coefficients_and_covariance_are_those_of_numpy(count, weighted, argument):
    rng = np.random.default_rng(7)
    runs = []
    for i in range(count):
        theta, error = readings(i, n=200, noise=0.05)
        weights = rng.uniform(0.5, 2, theta.size) if weighted else None
        runs.append(ta.CalibrationRun(theta, theta + error + i, 360.0, weights=weights))
    result = ta.fit(runs, orders=ORDERS, argument=argument, covariance="white")
    expected = reference.fit(runs, [(1.0, ORDERS)], argument)
    scale = np.abs(expected.coefficients).max()
    np.testing.assert_allclose(
        coefficients(result.model), expected.coefficients, rtol=0, atol=AGREE * scale
    )
    np.testing.assert_allclose(result.offsets, expected.offsets, rtol=0, atol=AGREE * 360)
    np.testing.assert_allclose(result.covariance[1:, 1:], expected.covariance, rtol=1e-9, atol=0)
    np.testing.assert_allclose(result.residuals, expected.residuals, rtol=0, atol=AGREE * 360)
    assert result.wild == ()


def test_several_shafts_of_any_ratio():
    rng = np.random.default_rng(3)
    theta = rng.uniform(0, 3600, 500)
    truth = 0.2 * np.cos(np.radians(theta)) + 0.05 * np.sin(np.radians(14.6 * theta) + 1)
    result = fitted(
        theta,
        theta + truth,
        orders={"output": [1, 2], "motor": [1, 2]},
        gear_ratio=7.3,
        fixed_member="none",
    )
    output, motor = result.model.shafts
    assert output.cosine[0] == pytest.approx(0.2, abs=1e-12)
    assert motor.amplitudes[1] == pytest.approx(0.05, abs=1e-12)
    assert motor.phases[1] == pytest.approx(1.0, abs=1e-9)
    assert any("unwrapped" in note for note in result.notes)


def test_standard_errors_agree_with_monte_carlo():
    sigma, draws = 0.02, 1500
    theta, error = readings(1, n=60, noise=0.0)
    rng = np.random.default_rng(2)
    found, claimed = [], []
    for _ in range(draws):
        result = fitted(theta, theta + error + sigma * rng.normal(size=60), loss="linear")
        found.append([*result.amplitudes, *result.phases, *coefficients(result.model)])
        std = np.sqrt(np.diag(result.covariance))[1:]
        claimed.append([*result.amplitude_std, *result.phase_std, *std])
    spread = np.std(found, axis=0, ddof=1)
    # A standard deviation from n draws has a relative standard error of 1/sqrt(2n) = 1.8 %;
    # 5 of them. Orders 1 and 5 are strong: their amplitudes and phases are normal.
    strong = [0, 2, 4, 6, *range(8, 16)]
    mean_claimed = np.sqrt(np.mean(np.square(claimed), axis=0))
    np.testing.assert_allclose(mean_claimed[strong], spread[strong], rtol=0.1)


@given(
    seed=st.integers(0, 2**16),
    zero=st.floats(-1000, 1000),
    turns=st.integers(-5, 5),
    fold=st.booleans(),
    reverse=st.booleans(),
    unit=st.sampled_from([1.0, 2 * math.pi, 65536.0]),
)
@settings(max_examples=60)
def test_zero_turns_wrapping_direction_and_unit_give_one_model(
    seed, zero, turns, fold, reverse, unit
):
    theta, error = readings(seed)
    plain = coefficients(fitted(theta, theta + error).model)
    # The same readings: any zero, several turns on, folded into a turn, backwards, other unit.
    reference_angle = theta + 360.0 * turns * np.sign(np.sin(np.arange(theta.size)))
    indicated = theta + error + zero
    if fold:
        reference_angle, indicated = np.mod(reference_angle, 360.0), np.mod(indicated, 360.0)
    order = slice(None, None, -1 if reverse else 1)
    scale = unit / 360.0
    again = fitted(reference_angle[order] * scale, indicated[order] * scale, period=unit)
    np.testing.assert_allclose(coefficients(again.model) / scale, plain, rtol=0, atol=REWRITTEN)
    expected_zero = np.mean(fitted(theta, theta + error).model.constant) + zero
    assert math.remainder(again.model.constant / scale - expected_zero, 360.0) == pytest.approx(
        0.0, abs=REWRITTEN * 1e3
    )


@given(seed=st.integers(0, 2**16))
@settings(max_examples=25)
def test_swapping_the_sign_of_all_angles_mirrors_the_model(seed):
    theta, error = readings(seed)
    model = fitted(theta, theta + error).model.shafts[0]
    mirrored = fitted(-theta, -(theta + error)).model.shafts[0]
    np.testing.assert_allclose(mirrored.cosine, np.negative(model.cosine), atol=REWRITTEN)
    np.testing.assert_allclose(mirrored.sine, model.sine, atol=REWRITTEN)


@given(seed=st.integers(0, 2**16), shift=st.floats(0, 360))
@settings(max_examples=25)
def test_turning_the_zero_of_the_reference_turns_phases_by_order(seed, shift):
    theta, error = readings(seed)
    model = fitted(theta, theta + error).model.shafts[0]
    turned = fitted(theta + shift, theta + shift + error).model.shafts[0]
    np.testing.assert_allclose(turned.amplitudes, model.amplitudes, atol=REWRITTEN)
    moved = np.array(model.phases) - np.radians(shift) * np.array(ORDERS)
    agreement = np.cos(turned.phases - moved)
    strong = model.amplitudes > 1e-2
    np.testing.assert_allclose(agreement[strong], 1.0, atol=REWRITTEN)


@given(seed=st.integers(0, 2**16))
@settings(max_examples=25)
def test_the_order_of_rows_does_not_matter(seed):
    theta, error = readings(seed)
    shuffled = np.random.default_rng(seed).permutation(theta.size)
    one = coefficients(fitted(theta, theta + error).model)
    other = coefficients(fitted(theta[shuffled], (theta + error)[shuffled]).model)
    np.testing.assert_allclose(other, one, rtol=0, atol=AGREE)


def test_every_run_has_its_own_zero_and_the_constant_is_their_circular_mean():
    theta, error = readings(4, noise=0.0)
    runs = [ta.CalibrationRun(theta, theta + error + z, 360.0) for z in (179.0, 181.0, -178.0)]
    result = ta.fit(runs, orders=ORDERS)
    differences = np.array([ta.wrap(z - result.offsets[0], 360.0) for z in result.offsets])
    np.testing.assert_allclose(differences, [0.0, 2.0, 3.0], atol=1e-9)
    assert result.offset_spread == pytest.approx(np.std([0, 2, 3], ddof=1), abs=1e-6)
    middle = float(ta.wrap(result.model.constant - result.offsets[0], 360.0))
    assert middle == pytest.approx(5 / 3, abs=1e-3)  # mean direction, not exactly the mean angle


@pytest.mark.parametrize(
    ("orders", "at_fault"),
    [(range(1, 19), "18"), ([1, 2, 35], "35.* 1 "), ([3, 39], "39.* 3 "), ([36], "36")],
)
def test_what_36_positions_cannot_tell_is_an_error_that_names_it(orders, at_fault):
    theta = np.append(np.arange(0.0, 360.0, 10.0), 360.0)
    runs = [ta.CalibrationRun(theta, theta + 0.1, 360.0) for _ in range(3)]
    with pytest.raises(errors.RankError, match=at_fault) as caught:
        ta.fit(runs, orders=orders)
    assert caught.value.orders


def test_fewer_angles_than_unknowns():
    with pytest.raises(errors.RankError, match="distinct"):
        fitted(np.arange(4.0) * 90, np.arange(4.0) * 90, orders=[1, 2, 3])


def test_all_35_unknowns_from_36_positions_as_in_the_paper():
    theta = np.arange(0.0, 360.0, 10.0)
    result = fitted(theta, theta + 0.01 * np.sin(np.radians(14 * theta)), orders=range(1, 18))
    assert result.model.shafts[0].sine[13] == pytest.approx(0.01, abs=1e-13)
    assert result.degrees_of_freedom == 1


@pytest.mark.parametrize(
    ("factor", "remedy"),
    [(-1.0, "sign"), (math.pi / 180, "radians"), (180 / math.pi, "degrees"), (1 / 360, "turns")],
)
def test_wrong_units_and_signs_are_named(factor, remedy):
    theta, error = readings(1)
    with pytest.raises(errors.ArgumentError, match=remedy):
        fitted(theta, factor * (theta + error))


@pytest.mark.parametrize("ratio", [7.3, 5.9, 6.6, 0.17])
def test_a_ratio_near_that_of_two_units_is_told_as_a_ratio(ratio):
    """Divided by 2 pi it agrees within a sixth of a turn, and is no unit all the same."""
    theta, error = readings(1)
    order = np.argsort(theta)
    with pytest.raises(errors.ArgumentError, match="looks like") as refused:
        fitted(theta[order], ratio * (theta + error)[order])
    (told,) = re.findall(r"it moves ([0-9.]+) times", str(refused.value))
    assert float(told) == pytest.approx(ratio, rel=0.01)
    assert "radians" not in str(refused.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"orders": [0]}, "whole numbers from 1"),
        ({"orders": [1.5]}, "whole numbers from 1"),
        ({"orders": 17}, "a list such as range"),
        ({"orders": {"motor": [1]}}, "gear_ratio"),
        ({"orders": "all"}, "auto"),
        ({"orders": [1], "loss": "cauchy"}, "loss"),
        ({"orders": {"motor": [1]}, "gear_ratio": 0.0}, "gear_ratio"),
        ({"orders": [1], "argument": "true"}, "argument"),
        ({"orders": [1], "fixed_member": "housing"}, "fixed_member"),
    ],
)
def test_bad_options_are_named(options, message):
    theta, error = readings(1)
    with pytest.raises(errors.TrueAngleError, match=message):
        fitted(theta, theta + error, **options)


def test_the_sign_of_a_gear_is_that_of_the_motor_that_was_read() -> None:
    theta = np.arange(0.0, 720.0, 0.9)
    error = 0.1 * np.sin(np.radians(theta)) + 0.02 * np.sin(np.radians(80.0 * theta))
    for turns, asked in ((80.0, -80.0), (-80.0, 80.0)):
        motor = ta.CalibrationRun(
            theta, theta + error, 360.0, signals={"motor": (turns * theta + 7.0) % 360.0}
        )
        with pytest.raises(ta.errors.ArgumentError, match=f"give `gear_ratio={turns:g}`"):
            ta.fit(motor, [1], gear_ratio=asked)
        assert not any("sign" in note for note in ta.fit(motor, [1], gear_ratio=turns).notes)
    bare = ta.CalibrationRun(theta, theta + error, 360.0)
    (note,) = [n for n in ta.fit(bare, [1], gear_ratio=-80.0).notes if "sign of the gear" in n]
    assert "record a column motor_deg" in note


def test_the_summary_tells_amplitudes_uncertainties_and_zeros():
    theta, error = readings(1, noise=0.01)
    runs = [ta.CalibrationRun(theta, theta + error + z, 360.0) for z in (0.0, 0.01)]
    text = " ".join(ta.fit(runs, orders=ORDERS).summary().split())
    assert "144 in 2 runs" in text
    assert "25.46 arcsec (standard deviation)" in text  # 0.01 deg apart: 36 arcsec / sqrt(2)


def test_the_record_says_what_the_model_saw(tmp_path):
    theta, error = readings(1)
    path = tmp_path / "joint.csv"
    np.savetxt(
        path,
        np.column_stack([theta, theta + error]),
        header="reference_deg,indicated_deg",
        delimiter=",",
        comments="",
    )
    model = ta.fit(ta.read_runs(path), orders=ORDERS).model
    assert (model.fit.samples, model.fit.runs, model.fit.span) == (72, 1, (0.0, 360.0))
    assert model.provenance.inputs[0].file == "joint.csv"
    model.save(tmp_path / "joint.json")
    assert ta.load_model(tmp_path / "joint.json") == model


@pytest.mark.parametrize("again", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_results_travel_to_other_processes(again):
    theta, error = readings(4)
    result = ta.fit(ta.CalibrationRun(theta, theta + error, 360.0))
    there = again(result)
    assert there.model == result.model
    np.testing.assert_array_equal(there.residuals, result.residuals)
    np.testing.assert_array_equal(there.covariance, result.covariance)
    assert there.summary() == result.summary()
    assert again(result.selection).orders == result.selection.orders


def test_results_show_themselves_in_a_line_and_a_notebook():
    theta, error = readings(4)
    result = ta.fit(ta.CalibrationRun(theta, theta + error, 360.0))
    for shown in (result, result.selection):
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 120
        assert "arcsec" in shown._repr_html_()


def test_an_unknown_way_of_solving_is_an_error_of_ours():
    theta, error = readings(4)
    with pytest.raises(errors.ArgumentError, match="method must be one of plain"):
        fitted(theta, theta + error, method="foo")


@pytest.mark.parametrize(("member", "cycles"), [("flexspline", 29.0), ("none", 30.0)])
def test_runs_are_held_out_with_the_gear_that_was_declared(member, cycles):
    """Order 29.5 of one gear is 31.5 of the other: only the declared one explains it."""
    rng = np.random.default_rng(8)
    ratio = 30.5
    line = ratio - 1.0 if member == "flexspline" else ratio
    runs = []
    for _ in range(3):
        x = np.sort(rng.uniform(0.0, 1800.0, 600))
        error = 0.1 * np.sin(np.radians(line * x)) + 0.01 * rng.normal(size=x.size)
        runs.append(ta.CalibrationRun(x, x + error, 360.0))
    result = ta.fit(runs, gear_ratio=ratio, fixed_member=member)
    gain = hold_out(result)
    assert all(run.model is not None and run.model.orders == (line,) for run in gain.runs)
    assert gain.reduction > 0.8


def test_amplitudes_and_phases_take_the_covariance_of_both_coefficients():
    """An arc, where cosine and sine correlate: by the gradient, sign and all."""
    rng = np.random.default_rng(12)
    theta = np.sort(rng.uniform(20.0, 230.0, 4000))
    result = fitted(
        theta,
        theta
        + 0.3 * np.sin(np.radians(theta + 50.0))
        + 0.1 * np.sin(np.radians(2.0 * theta + 200.0))
        + 0.01 * rng.normal(size=theta.size),
        orders=[1, 2],
        ridge=0.0,
        covariance="white",
    )
    cov, shaft = result.covariance, result.model.shafts[0]
    for k in range(2):
        a, b = shaft.cosine[k], shaft.sine[k]
        pair = cov[1 + 2 * k : 3 + 2 * k, 1 + 2 * k : 3 + 2 * k]
        assert abs(pair[0, 1]) > 0.3 * math.sqrt(pair[0, 0] * pair[1, 1])
        step, size = 1e-7, math.hypot(a, b)
        gradient = [
            (math.hypot(a + step, b) - math.hypot(a - step, b)) / (2 * step),
            (math.hypot(a, b + step) - math.hypot(a, b - step)) / (2 * step),
        ]
        turn = [
            (math.atan2(a + step, b) - math.atan2(a - step, b)) / (2 * step),
            (math.atan2(a, b + step) - math.atan2(a, b - step)) / (2 * step),
        ]
        assert size > 10 * math.sqrt(pair.trace())
        expected = math.sqrt(np.array(gradient) @ pair @ gradient)
        assert result.amplitude_std[k] == pytest.approx(expected, rel=1e-4)
        expected = math.sqrt(np.array(turn) @ pair @ turn)
        assert result.phase_std[k] == pytest.approx(expected, rel=1e-4)
