"""Correction with terms against physics done slowly, and its state."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import trueangle as ta
from trueangle import errors
from trueangle.model.terms import ScaleError, VaryingLine

# The motion goes beyond the travel of the ramp, which is held there.
pytestmark = pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")

# The contract: theta + error(theta) = indicated is solved to below 1e-12 of a turn.
SOLVED = 1e-12
# Sums of a few terms of size 1 around angles of a few turns.
ROUNDING = 1e-14


def joint(period=360.0, terms=(), argument="reference", constant=0.0):
    """About 0.3 deg of eccentricity and gear lines, as fractions of the period."""
    unit = period / 360.0
    return ta.HarmonicModel(
        (
            ta.Shaft("output", 1.0, (1, 2), (0.3 * unit, 0.0), (0.1 * unit, 0.05 * unit)),
            ta.Shaft("motor", 50.0, (1, 2), (0.004 * unit, 0.0), (0.0, 0.002 * unit)),
        ),
        constant=constant,
        period=period,
        argument=argument,
        terms=terms,
    )


def every_term(period=360.0):
    unit = period / 360.0
    return (
        ta.Backlash(0.02 * unit),
        ta.PreslidingHysteresis(0.01 * unit, 3.0 * unit),
        ta.PreslidingHysteresis(0.004 * unit, 0.3 * unit, 1.0),
        ta.Latency(1.5e-3),
        ta.FilterLag(40.0),
        ta.ThermalDrift(2e-3 * unit, 1e-3, [1, 51], [1e-3 * unit, 0], [0, 2e-5 * unit], 20.0),
        ta.TorsionalCompliance(3e-3 * unit, [1], [1e-3 * unit], [0]),
        ta.StiffeningCompliance(1e-3 * unit, 2e-6 * unit, -2e-4 * unit, 3.0, 30.0 * unit),
        ta.LoadDependentGearError([100.5], [1e-5 * unit], [2e-5 * unit], "absolute"),
        ta.LocalDefect(100.0 * unit, 8.0 * unit, 0.01 * unit, 3.0),
        ScaleError(2e-4, -90.0 * unit, 250.0 * unit),
    )


def motion(rng, n=2000, period=360.0):
    """Angle, velocity, temperature and torque of a joint that turns back and forth."""
    t = np.linspace(0.0, 20.0, n)
    a, b = rng.uniform(100.0, 300.0, 2) * period / 360.0
    f, g = rng.uniform(0.2, 1.2, 2)
    theta = a * np.sin(f * t) + b * np.sin(g * t)
    velocity = a * f * np.cos(f * t) + b * g * np.cos(g * t)
    signals = {
        "velocity": velocity,
        "temperature": 20.0 + 15.0 * np.sin(0.1 * t),
        "torque": 8.0 * np.sin(1.3 * t),
    }
    return theta, signals


@pytest.mark.parametrize("period", [2.0 * math.pi, 360.0, 1.0, 65536.0])
@pytest.mark.parametrize("directed", [True, False])
def test_correct_is_the_inverse_of_error(period, directed):
    theta, signals = motion(np.random.default_rng(1), period=period)
    terms = every_term(period)
    if not directed:  # travel is then seen in the angle alone
        terms = tuple(term for term in terms if "velocity" not in term.signals)
        del signals["velocity"]
    model = joint(period, terms, constant=0.4 * period)
    error = model.error(theta, **signals)
    corrected = model.correct(theta + error, **signals)
    np.testing.assert_allclose(corrected, theta, rtol=0, atol=SOLVED * period)


@given(seed=st.integers(0, 2**32 - 1), which=st.sets(st.integers(0, 9), min_size=1))
def test_any_choice_of_terms_is_inverted(seed, which):
    theta, signals = motion(np.random.default_rng(seed), n=300)
    model = joint(terms=[every_term()[i] for i in sorted(which)])
    error = model.error(theta, **signals)
    corrected = model.correct(theta + error, **signals)
    np.testing.assert_allclose(corrected, theta, rtol=0, atol=SOLVED * 360)


@pytest.mark.parametrize("width", [0.15, 0.3, 1.0])
def test_a_narrow_defect_beside_next_to_no_series_is_inverted(width):
    """The slope changes much over a step, and no series tells how well the step went."""
    shaft = ta.Shaft("output", 1.0, (1,), (1e-9,), (0.0,))
    model = ta.HarmonicModel(
        (shaft,), period=360.0, terms=(ta.LocalDefect(100.0, width, 0.1 * width, 1.0),)
    )
    theta = np.linspace(100.0 - 5.0 * width, 100.0 + 5.0 * width, 4001)
    corrected = model.correct(theta + model.error(theta))
    np.testing.assert_allclose(corrected, theta, rtol=0, atol=SOLVED * 360)


def test_a_pattern_at_the_indicated_angle_is_taken_off_first():
    theta, signals = motion(np.random.default_rng(2))
    plain, terms = joint(argument="indicated"), every_term()
    model = plain.replace(terms=terms)
    # The terms alone, around what the pattern leaves.
    straight = ta.HarmonicModel([], period=360.0, terms=[t for t in terms if _alone(t)])
    model = plain.replace(terms=straight.terms)
    expected = straight.correct(plain.correct(theta), **signals)
    np.testing.assert_allclose(model.correct(theta, **signals), expected, atol=SOLVED * 360)
    np.testing.assert_array_equal(
        model.error(theta, **signals), theta - model.correct(theta, **signals)
    )


def _alone(term):
    """True for terms that do not change the harmonics."""
    return term.kind != "filter_lag" and not getattr(term, "pattern_per_K", 0.0)


# -- each effect against its physics -------------------------------------------------


def test_latency_shows_the_angle_of_a_time_before():
    delay, t = 2e-3, np.linspace(0.0, 10.0, 5001)
    plain = joint()

    def angle(time):
        return 100.0 + 35.0 * time

    seen = angle(t - delay)
    indicated = seen + plain.error(seen)
    model = plain.replace(terms=[ta.Latency(delay)])
    np.testing.assert_allclose(
        model.correct(indicated, velocity=35.0), angle(t), rtol=0, atol=SOLVED * 360
    )
    # Correcting the ramp alone would leave the shifted pattern.
    assert np.abs(plain.correct(indicated) - angle(t)).max() > 35.0 * delay * 0.9
    ramp_only = plain.correct(indicated + 35.0 * delay)
    assert np.abs(ramp_only - angle(t)).max() > 1e-4


def test_latency_leaves_half_the_acceleration_times_the_delay_squared():
    delay, t = 5e-3, np.linspace(0.0, 1.0, 1001)
    acceleration = 400.0
    plain = joint()
    seen = 0.5 * acceleration * (t - delay) ** 2
    model = plain.replace(terms=[ta.Latency(delay)])
    left = model.correct(seen + plain.error(seen), velocity=acceleration * t)
    left -= 0.5 * acceleration * t**2
    np.testing.assert_allclose(left, 0.5 * acceleration * delay**2, rtol=1e-6)


def test_filter_lag_is_a_low_pass_on_the_pattern_in_time():
    cutoff, speed = 30.0, 120.0
    plain = joint()
    slow = 2.0 * np.pi * cutoff
    start = -20.0 / slow  # long enough for the filter to forget its start

    def lag(t, y):
        return slow * (plain.error(speed * t) - y)

    t = np.linspace(0.0, 3.0, 301)
    passed = solve_ivp(
        lag, (start, t[-1]), [plain.error(speed * start)], t_eval=t, rtol=1e-10, atol=1e-12,
        method="DOP853", max_step=1e-3,
    ).y[0]  # fmt: skip
    model = plain.replace(terms=[ta.FilterLag(cutoff)])
    theta = speed * t
    # exp(-20) of the start, 1e-10 of the integration.
    np.testing.assert_allclose(model.error(theta, velocity=speed), passed, rtol=0, atol=3e-9)
    assert np.abs(plain.error(theta) - passed).max() > 1e-3
    corrected = model.correct(theta + passed, velocity=speed)
    np.testing.assert_allclose(corrected, theta, rtol=0, atol=3e-9)


def test_hysteresis_follows_the_differential_equation_of_dahl():
    h, length = 0.01, 2.5
    model = ta.HarmonicModel([], period=360.0, terms=[ta.PreslidingHysteresis(h, length)])
    t = np.linspace(0.0, 6.0, 4001)
    theta = 9.0 * np.sin(t) + 4.0 * np.sin(3.3 * t)
    rate = 9.0 * np.cos(t) + 13.2 * np.cos(3.3 * t)

    def relax(time, z):
        v = 9.0 * math.cos(time) + 13.2 * math.cos(3.3 * time)
        return [(math.copysign(1.0, v) - z[0]) * abs(v) / length]

    z = solve_ivp(relax, (0.0, 6.0), [0.0], t_eval=t, rtol=1e-9, atol=1e-11, max_step=1e-3).y[0]
    # Reversals fall between samples: the way to the turning point and back is missing,
    # here up to a (step/2)^2 of about 7e-6 deg, times 2 h / L.
    missed = 2.0 * h / length * 1e-4
    np.testing.assert_allclose(model.error(theta), h * z, rtol=0, atol=missed)
    np.testing.assert_allclose(
        model.correct(theta + h * z, direction=rate), theta, rtol=0, atol=2.0 * missed
    )


def test_a_long_stretch_leaves_the_exponential_of_the_catalogue():
    h, length = 0.01, 2.0
    model = ta.HarmonicModel([], period=360.0, terms=[ta.PreslidingHysteresis(h, length)])
    there, back = np.linspace(0.0, 100.0, 101), np.linspace(100.0, 80.0, 201)
    error = model.error(np.concatenate([there, back]))[101:]
    s = 100.0 - back
    # d (1 - 2 exp(-s/L)) with d = -1; exp(-50) of the start is left.
    np.testing.assert_allclose(error, -h * (1.0 - 2.0 * np.exp(-s / length)), atol=1e-15)


def test_play_is_undone_without_any_direction():
    """The output of a dead band, simulated step by step, from the input alone."""
    b = 0.05
    rng = np.random.default_rng(7)
    turned = np.cumsum(rng.normal(0.0, 0.03, 4000)) + 20.0 * np.sin(np.linspace(0.0, 20.0, 4000))
    output = np.empty_like(turned)
    output[0] = turned[0]
    for i in range(1, turned.size):
        output[i] = min(max(output[i - 1], turned[i] - b), turned[i] + b)
    plain = joint()
    model = plain.replace(terms=[ta.Backlash(b)])
    # The encoder with its own pattern sits on the driven side: what it indicates is
    # output + pattern(output) while the output moves, and moves on alone in the play.
    indicated = turned + plain.error(output)
    corrected = model.correct(indicated)
    np.testing.assert_allclose(corrected, output, rtol=0, atol=SOLVED * 360)


def test_backlash_by_the_sign_of_a_signal():
    model = ta.HarmonicModel([], period=360.0, terms=[ta.Backlash(0.5)])
    x = np.array([10.0, 11.0, 12.0, 12.0, 11.0, 11.0])
    d = [0.0, 3.0, 0.0, 0.0, -0.1, 0.0]
    expected = x - 0.5 * np.array([0.0, 1.0, 1.0, 1.0, -1.0, -1.0])
    np.testing.assert_array_equal(model.correct(x, direction=d), expected)
    np.testing.assert_array_equal(model.correct(x, velocity=d), expected)
    # A direction wins over a velocity.
    np.testing.assert_array_equal(model.correct(x, direction=d, velocity=-1.0), expected)


def test_negative_play_needs_a_direction():
    model = ta.HarmonicModel([], period=360.0, terms=[ta.Backlash(-0.5)])
    with pytest.raises(errors.MissingSignalError, match=r"'backlash' needs direction"):
        model.correct([1.0, 2.0])
    np.testing.assert_array_equal(model.correct([1.0, 2.0], velocity=1.0), [1.5, 2.5])


def test_thermal_and_load_terms_against_their_formulas():
    theta, signals = motion(np.random.default_rng(3))
    plain = joint(constant=0.2)
    warm, load = signals["temperature"] - 20.0, signals["torque"]
    x = np.radians(theta)
    pattern = plain.error(theta) - 0.2
    moment = load * np.sin(x - np.radians(30.0))
    cases = {
        ta.ThermalDrift(2e-3, 1e-3, [1, 51.5], [1e-3, 0], [0, 2e-5]): warm
        * (2e-3 + 1e-3 * pattern + 1e-3 * np.cos(x) + 2e-5 * np.sin(51.5 * x)),
        ta.TorsionalCompliance(3e-3, [2], [1e-3], [-1e-3]): load
        * (3e-3 + 1e-3 * np.cos(2 * x) - 1e-3 * np.sin(2 * x)),
        ta.StiffeningCompliance(1e-3, 2e-6, -2e-4, 3.0): 1e-3 * load
        + 2e-6 * load**3
        - 2e-4 * np.sign(load) * np.maximum(np.abs(load) - 3.0, 0.0),
        ta.StiffeningCompliance(1e-3, 2e-6, -2e-4, 3.0, 30.0): 1e-3 * moment
        + 2e-6 * moment**3
        - 2e-4 * np.sign(moment) * np.maximum(np.abs(moment) - 3.0, 0.0),
        ta.LoadDependentGearError([100], [1e-4], [0]): load * 1e-4 * np.cos(100 * x),
        ta.LoadDependentGearError([100], [1e-4], [0], "absolute"): np.abs(load)
        * 1e-4
        * np.cos(100 * x),
        ta.LocalDefect(100.0, 8.0, 0.01, 3.0): 0.01
        * np.exp(-0.5 * ((np.mod(3.0 * theta - 100.0 + 180.0, 360.0) - 180.0) / 8.0) ** 2),
        ScaleError(2e-4, -90.0, 250.0): 2e-4 * (np.clip(theta, -90.0, 250.0) - 80.0),
    }
    speed = signals["velocity"]
    for follows, x_of in (("speed", np.abs(speed)), ("velocity", speed), ("torque", load)):
        line = VaryingLine([3.5], [1e-4], [2e-4], follows)
        cases[line] = x_of * (1e-4 * np.cos(3.5 * x) + 2e-4 * np.sin(3.5 * x))
    for term, expected in cases.items():
        model = plain.replace(terms=[term])
        added = model.error(theta, **signals) - plain.error(theta)
        # numpy rounds 100 x at a few turns; the difference of errors of 0.5 deg.
        np.testing.assert_allclose(added, expected, rtol=1e-11, atol=1e-12, err_msg=str(term))


# -- state -----------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32 - 1), directed=st.booleans())
def test_steps_batches_and_the_whole_log_are_one(seed, directed):
    rng = np.random.default_rng(seed)
    theta, signals = motion(rng, n=400)
    terms = [t for t in every_term() if directed or "velocity" not in t.signals]
    if not directed:
        del signals["velocity"]
    model = joint(terms=terms)
    indicated = theta + 0.3 * np.cos(theta) * 1e-2
    whole = model.correct(indicated, **signals)

    step = model.compensator()
    columns = list(signals.values())
    steps = [
        step(x, **dict(zip(signals, values, strict=True)))
        for x, *values in zip(indicated.tolist(), *(c.tolist() for c in columns), strict=True)
    ]
    np.testing.assert_array_equal(steps, whole)

    corrector = model.corrector()
    cuts = np.sort(rng.integers(0, 400, 5))
    parts = [
        corrector(part, **dict(zip(signals, values, strict=True)))
        for part, *values in zip(
            np.split(indicated, cuts), *(np.split(c, cuts) for c in columns), strict=True
        )
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    corrector.reset()
    np.testing.assert_array_equal(corrector(indicated, **signals), whole)


def test_readings_that_are_not_finite_leave_the_state_alone():
    model = joint(terms=every_term())
    theta, signals = motion(np.random.default_rng(4), n=200)
    whole = model.correct(theta, **signals)
    for name in ("indicated", *signals):
        broken = {"indicated": theta, **signals}
        # Two readings in the middle go wrong; the rest is as if they had not been there.
        clean = {key: np.delete(values, [90, 91]) for key, values in broken.items()}
        broken[name] = broken[name].copy()
        broken[name][[90, 91]] = np.nan, np.inf
        result = model.correct(broken.pop("indicated"), **broken)
        assert np.isnan(result[[90, 91]]).all()
        np.testing.assert_array_equal(result[:90], whole[:90])
        expected = model.correct(clean.pop("indicated"), **clean)
        np.testing.assert_array_equal(np.delete(result, [90, 91]), expected)


def test_angles_within_one_turn_are_as_good_as_unwrapped_ones():
    terms = [t for t in every_term() if t.is_periodic and t.kind != "load_dependent_gear_error"]
    model = joint(terms=terms)
    theta, signals = motion(np.random.default_rng(5))
    corrected = model.correct(theta, **signals)
    wrapped = model.correct(np.mod(theta, 360.0), **signals)
    turns = (wrapped - corrected) / 360.0
    np.testing.assert_allclose(turns, np.round(turns), rtol=0, atol=SOLVED)
    assert np.abs(np.round(turns)).max() >= 1


def test_velocity_comes_from_time_stamps_where_it_is_not_given():
    t = np.arange(0.0, 5.0, 1e-3)
    theta = 40.0 * t
    delay = 3e-3
    plain = joint()
    seen = theta - 40.0 * delay
    indicated = seen + plain.error(seen)
    corrector = plain.replace(terms=[ta.Latency(delay)]).corrector()
    parts = [
        corrector(x, time=s)
        for x, s in zip(np.array_split(indicated, 7), np.array_split(t, 7), strict=True)
    ]
    # The indicated angle runs up to 1 + |error'| times as fast as the true one.
    slope = np.abs(np.gradient(indicated, theta) - 1.0).max()
    assert np.abs(np.concatenate(parts) - theta).max() < 1.1 * 40.0 * delay * slope


# -- arguments ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("term", "signal", "column"),
    [
        (ta.Latency(1e-3), "velocity", "velocity_deg_s"),
        (ta.FilterLag(10.0), "velocity", "velocity_deg_s"),
        (ta.ThermalDrift(1e-3), "temperature", "temperature_C"),
        (ta.TorsionalCompliance(1e-3), "torque", "torque_Nm"),
        (ta.StiffeningCompliance(1e-3), "torque", "torque_Nm"),
        (ta.LoadDependentGearError([2], [1e-3], [0]), "torque", "torque_Nm"),
    ],
)
def test_a_missing_signal_is_named_with_its_term_and_column(term, signal, column):
    model = joint(terms=[ta.Backlash(0.1), term])
    given = {"velocity": 1.0, "temperature": 1.0, "torque": 1.0}
    del given[signal]
    message = f"'{term.kind}' needs {signal}.*{signal}=.*{column}"
    with pytest.raises(errors.MissingSignalError, match=message):
        model.correct([1.0, 2.0], **given)
    with pytest.raises(errors.MissingSignalError, match=message):
        model.correct(1.0, **given)
    with pytest.raises(errors.MissingSignalError, match=message):
        model.error([1.0, 2.0], **given)
    with pytest.raises(errors.MissingSignalError, match=message):
        model.compensator()(1.0, **given)
    with pytest.raises(errors.MissingSignalError, match=message):
        model.corrector()([1.0], **given)


def test_shapes_types_and_out_are_those_of_a_model_without_terms():
    model = joint(terms=[ta.ThermalDrift(1e-3), ta.Backlash(0.01)])
    assert isinstance(model.correct(10.0, temperature=30.0), float)
    assert isinstance(model.correct(np.array(10.0), temperature=30.0), np.float64)
    assert model.correct([1, 2, 3], temperature=30).dtype == np.float64
    single = model.correct(np.ones((2, 3), np.float32), temperature=30.0)
    assert single.dtype == np.float32
    assert single.shape == (2, 3)
    assert model.correct(5.0, temperature=[20.0, 30.0]).shape == (2,)
    assert model.correct(np.zeros(0), temperature=np.zeros(0)).shape == (0,)
    x = np.linspace(0.0, 300.0, 12).reshape(3, 4)[:, ::2]
    expected = model.correct(x, temperature=30.0)
    out = np.empty_like(x)
    assert model.correct(x, out, temperature=30.0) is out
    np.testing.assert_array_equal(out, expected)
    work = x.copy()
    model.correct(work, out=work, temperature=30.0)
    np.testing.assert_array_equal(work, expected)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda m: m.correct([1.0, 2.0], temperature=[1.0, 2.0, 3.0]), r"temperature \(3,\)"),
        (
            lambda m: m.correct([1.0, 2.0], out=np.empty(3), temperature=1.0),
            r"shape of the angles \(2,\), got \(3,\)",
        ),
        (lambda m: m.correct([1.0], out=np.empty(1, np.float32), temperature=1.0), "float64"),
        (lambda m: m.correct(["a"], temperature=1.0), "angles must be real numbers"),
        (lambda m: m.correct([1.0], temperature=["a"]), "temperature must be real numbers"),
        (lambda m: m.correct(np.ma.masked_equal([1.0], 1.0), temperature=1.0), "masked"),
    ],
)
def test_bad_arguments_are_named(call, said):
    with pytest.raises(errors.ArgumentError, match=said):
        call(joint(terms=[ta.ThermalDrift(1e-3)]))


def test_signals_that_a_model_does_not_use_are_ignored():
    plain, warm = joint(), joint(terms=[ta.ThermalDrift(1e-3)])
    x = np.linspace(0.0, 300.0, 7)
    nothing = np.full(7, np.nan)
    np.testing.assert_array_equal(plain.correct(x, torque=nothing), plain.correct(x))
    np.testing.assert_array_equal(
        warm.correct(x, temperature=25.0, torque=nothing, velocity=nothing),
        warm.correct(x, temperature=25.0),
    )
    assert plain.corrector()(x, torque=nothing).tolist() == plain.correct(x).tolist()


def test_signals_that_leave_no_unique_angle_give_nan():
    model = joint(terms=[ta.ThermalDrift(orders=[1], cosine=[1.0], sine=[0.0])])
    # 1 deg per kelvin at order 1: from 57 K on the error's slope exceeds 1.
    result = model.correct([10.0] * 4, temperature=[25.0, 220.0, 1e4, 1e6])
    assert np.isfinite(result[0])
    assert np.isnan(result[1:]).all()


def test_a_state_is_that_of_a_corrector_with_such_terms():
    model = ta.HarmonicModel([], period=360.0, terms=[ta.Backlash(0.5)])
    first, second = model.corrector(), model.corrector()
    first([10.0, 20.0], time=[0.0, 1.0])
    second.state = first.state
    assert second([19.8]) == first([19.8]) == 19.5
    with pytest.raises(ta.errors.ArgumentError, match="not the state"):
        second.state = (*first.state, 0.0)
