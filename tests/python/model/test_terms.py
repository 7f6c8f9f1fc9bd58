"""Terms: their parameters, their checks, their place in the model file."""

import json
import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle import errors
from trueangle.model.terms import (
    TERMS,
    ChannelSkew,
    CurrentCoupling,
    Curve,
    DirectionalPattern,
    JointCoupling,
    ScaleError,
    VaryingLine,
)

numbers = st.floats(-1e-3, 1e-3)
lines = st.lists(st.tuples(st.floats(0.5, 500.0), numbers, numbers), max_size=3).map(
    lambda rows: {
        name: tuple(row[i] for row in rows) for i, name in enumerate(("orders", "cosine", "sine"))
    }
)


@st.composite
def any_terms(draw):
    return (
        ta.Backlash(draw(numbers)),
        ta.PreslidingHysteresis(
            draw(numbers), draw(st.floats(0.1, 100.0)), draw(st.floats(0.0, 1.0))
        ),
        DirectionalPattern(**draw(lines)),
        ChannelSkew(draw(numbers), draw(st.floats(0.5, 500.0)), draw(numbers)),
        VaryingLine(**draw(lines), follows=draw(st.sampled_from(["speed", "torque"]))),
        ta.Latency(draw(numbers)),
        ta.FilterLag(draw(st.floats(0.1, 1e4))),
        ta.ThermalDrift(draw(numbers), draw(numbers), **draw(lines), reference_C=draw(numbers)),
        ta.TorsionalCompliance(draw(numbers), **draw(lines)),
        ta.StiffeningCompliance(
            draw(numbers), draw(numbers), draw(numbers), draw(st.floats(0.0, 9.0)), draw(numbers)
        ),
        CurrentCoupling(draw(numbers), **draw(lines)),
        JointCoupling(draw(st.text(min_size=1, max_size=9)), draw(numbers)),
        ta.LoadDependentGearError(
            **draw(lines), torque=draw(st.sampled_from(["signed", "absolute"]))
        ),
        ta.LocalDefect(
            draw(numbers), draw(st.floats(1.0, 9.0)), draw(numbers), draw(st.floats(0.1, 200.0))
        ),
        ScaleError(
            draw(st.floats(-0.3, 0.3)), draw(st.floats(-9.0, 0.0)), draw(st.floats(1.0, 9.0))
        ),
        Curve("torque", (draw(st.floats(-9.0, 0.0)), 1.0, 2.5), draw(st.tuples(*[numbers] * 3))),
    )


def model_with(*terms, **changes):
    shaft = ta.Shaft("output", 1.0, (1, 2), (0.01, 0.0), (0.0, 0.02))
    return ta.HarmonicModel((shaft,), period=360.0, terms=terms, **changes)


@given(terms=any_terms())
def test_every_term_survives_the_file_bit_for_bit(terms, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "m.json"
    model = model_with(*terms)
    model.save(path)
    back = ta.load_model(path)
    assert back == model
    assert [repr(term) for term in back.terms] == [repr(term) for term in terms]
    assert {term.kind for term in terms} == set(TERMS)


def test_a_model_with_terms_is_a_value():
    model = model_with(ta.Backlash(0.01), ta.ThermalDrift(1e-3, orders=[1], cosine=[0], sine=[1]))
    assert pickle.loads(pickle.dumps(model)) == model
    assert hash(model) == hash(model.replace())
    assert model != model.replace(terms=())


def saved(tmp_path, term):
    path = tmp_path / "m.json"
    model_with(ta.Backlash(0.01)).save(path)
    content = json.loads(path.read_text())
    content["terms"] = [term]
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("term", "said"),
    [
        ({"kind": "wobble", "size": 1.0}, r"terms\[0\].kind.*'wobble' is unknown.*backlash"),
        ({"half_width": 1.0}, r"terms\[0\].kind.*null is unknown"),
        ({"kind": "backlash"}, r"terms\[0\].*needs the parameter 'half_width'"),
        ({"kind": "backlash", "half_width": 1.0, "x": 2}, r"terms\[0\].*no parameter 'x'"),
        ({"kind": "backlash", "half_width": "1"}, r"terms\[0\].*half_width must be a finite"),
        ({"kind": "backlash", "half_width": True}, r"terms\[0\].*half_width.*number"),
        ({"kind": "backlash", "half_width": None}, r"terms\[0\].*half_width must be a finite"),
        ({"kind": "filter_lag", "cutoff_hz": 0}, r"terms\[0\].*cutoff_hz must be positive"),
        ({"kind": "thermal_drift", "orders": [1]}, r"terms\[0\].*equally long"),
        ({"kind": "thermal_drift", "orders": 1}, r"terms\[0\].*orders must be a list"),
        ("backlash", r"terms\[0\].*an object"),
    ],
)
def test_files_with_impossible_terms_are_refused(tmp_path, term, said):
    path = saved(tmp_path, term)
    with pytest.raises(errors.ModelFileError, match=said) as caught:
        ta.load_model(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ta.Backlash(math.nan), "half_width must be a finite number"),
        (lambda: ta.PreslidingHysteresis(1.0, 0.0), "length must be positive"),
        (lambda: ta.PreslidingHysteresis(1.0, 1.0, 1.5), "start must be from 0 to 1"),
        (lambda: ta.LocalDefect(0.0, 0.0, 1.0), "width must be positive"),
        (lambda: ScaleError(0.1, 3.0, 3.0), r"stop must be beyond start \(3.0\)"),
        (lambda: ScaleError(1.0, 0.0, 3.0), "relative_error must be between -1 and 1"),
        (lambda: ta.LocalDefect(0.0, 1.0, 1.0, -1.0), "cycles_per_turn must be positive"),
        (lambda: ta.StiffeningCompliance(knee_Nm=-1.0), "knee_Nm must be 0 or more"),
        (lambda: ta.LoadDependentGearError([0.0], [1.0], [1.0]), "orders must be positive"),
        (lambda: ta.LoadDependentGearError([1], [1], [1], "both"), "torque must be one of signed"),
        (lambda: ta.LoadDependentGearError([1], [1, 2], [1]), "equally long"),
        (lambda: model_with("backlash"), r"terms\[0\] must be a term"),
    ],
)
def test_parameters_are_checked(make, said):
    with pytest.raises(errors.ArgumentError, match=said):
        make()


def test_friction_too_steep_to_invert_is_refused():
    # d error / d angle reaches 2 h / L right after a reversal.
    model_with(ta.PreslidingHysteresis(0.45, 1.0))
    with pytest.raises(errors.NotInvertibleError):
        model_with(ta.PreslidingHysteresis(0.5, 1.0))


def test_models_name_the_signals_they_need():
    assert model_with().signals == ()
    assert model_with(ta.Backlash(1.0)).signals == ()
    assert model_with(ta.Backlash(1.0)).uses_signals == ("direction", "velocity")
    assert model_with(ta.Backlash(-1.0)).signals == ("direction",)
    every = model_with(ta.Latency(1e-3), ta.ThermalDrift(1e-3), ta.TorsionalCompliance(1e-3))
    assert every.signals == every.uses_signals == ("velocity", "temperature", "torque")


def test_lines_of_broken_order_make_the_model_aperiodic():
    assert model_with(ta.TorsionalCompliance(0.0, [3], [1e-3], [0])).is_periodic
    assert not model_with(ta.TorsionalCompliance(0.0, [2.5], [1e-3], [0])).is_periodic
