"""Data with labels, single samples, copies: what goes in comes out as what it is."""

from __future__ import annotations

import copy
import pickle
from decimal import Decimal

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError

SHAFT = ta.Shaft("output", 1, [1, 5], [0.3, 0.1], [0.0, -0.2])
#: Of a step without a table, which iterates by itself.
ROUNDING = 1e-15

ANGLES = np.array([10.0, np.nan, 350.0, 725.0])


def models() -> dict[str, ta.HarmonicModel]:
    plain = ta.HarmonicModel([SHAFT], 0.25, 360.0)
    return {
        "plain": plain,
        "indicated": plain.replace(argument="indicated"),
        "not periodic": plain.replace(shafts=[ta.Shaft("roll", 1.37, [1], [0.3], [0.0])]),
        "torque": plain.replace(terms=[ta.TorsionalCompliance(0.01)]),
        "backlash": plain.replace(terms=[ta.Backlash(0.02)]),
        "partial": partial(plain),
    }


def partial(model: ta.HarmonicModel) -> ta.HarmonicModel:
    from trueangle.model.records import FitRecord

    return model.replace(fit=FitRecord(samples=9, runs=1, span=(330.0, 400.0), residual=0.1))


MODELS = models()
SIGNALS = {"torque": 2.0, "direction": 1.0}


@pytest.fixture(params=MODELS)
def model(request) -> ta.HarmonicModel:
    return MODELS[request.param]


def computations(model):
    return [
        lambda x, **more: model.error(x, **SIGNALS, **more),
        lambda x, **more: model.correct(x, **SIGNALS, **more),
    ]


def test_series_of_pandas_keep_name_and_index(model):
    pandas = pytest.importorskip("pandas")
    for dtype in ("float64", "float32", "Float64"):
        series = pandas.Series(ANGLES, index=list("abcd"), name="joint", dtype=dtype)
        for compute in computations(model):
            result = compute(series)
            assert isinstance(result, pandas.Series)
            assert result.name == "joint"
            assert list(result.index) == list("abcd")
            expected = compute(ANGLES.astype(np.float32 if dtype == "float32" else np.float64))
            np.testing.assert_array_equal(result.to_numpy(), expected)
    counts = pandas.Series([1, 2, 3], dtype="Int64")
    assert isinstance(model.error(counts, **SIGNALS), pandas.Series)
    frame = pandas.DataFrame({"a": ANGLES, "b": ANGLES}, index=list("wxyz"))
    assert list(model.error(frame, **SIGNALS).columns) == ["a", "b"]


def test_series_of_polars_keep_their_name(model):
    polars = pytest.importorskip("polars")
    series = polars.Series("joint", [10.0, None, 350.0, 725.0])
    for compute in computations(model):
        result = compute(series)
        assert isinstance(result, polars.Series)
        assert result.name == "joint"
        np.testing.assert_array_equal(result.to_numpy(), compute(ANGLES))


def test_arrays_of_xarray_keep_coordinates(model):
    xarray = pytest.importorskip("xarray")
    array = xarray.DataArray(
        ANGLES, dims="time", coords={"time": [1, 2, 3, 4]}, name="joint", attrs={"units": "deg"}
    )
    for compute in computations(model):
        result = compute(array)
        assert isinstance(result, xarray.DataArray)
        assert (result.name, result.attrs) == ("joint", {"units": "deg"})
        assert result.coords["time"].to_numpy().tolist() == [1, 2, 3, 4]
        np.testing.assert_array_equal(result.to_numpy(), compute(ANGLES))


def test_signals_with_labels_are_taken():
    pandas = pytest.importorskip("pandas")
    model, torque = MODELS["torque"], np.array([0.0, 1.0, 2.0, 3.0])
    labelled = model.correct(pandas.Series(ANGLES), torque=pandas.Series(torque))
    np.testing.assert_array_equal(labelled, model.correct(ANGLES, torque=torque))


def test_masked_arrays_are_refused_in_one_line(model):
    masked = np.ma.masked_array(ANGLES, mask=[0, 1, 0, 0])
    for compute in computations(model):
        with pytest.raises(
            ArgumentError, match=r"masked arrays are not supported.*fill"
        ) as refusal:
            compute(masked)
        assert "\n" not in str(refusal.value)
    with pytest.raises(ArgumentError, match="torque: masked arrays"):
        MODELS["torque"].correct(ANGLES, torque=masked)


#: What no angle is. Text and the like raise what is a `TypeError` as well.
REFUSED = [True, np.True_, "1", None, 1j, Decimal(1), [1.0, 2.0], np.ones(2), object(), 10**400]


@pytest.mark.parametrize("angle", REFUSED, ids=[type(v).__name__ for v in REFUSED])
def test_a_step_refuses_what_a_correction_refuses(model, angle):
    for step in (model.compensator(), model.corrector().step):
        with pytest.raises(ArgumentError):
            step(angle)
    if not isinstance(angle, (list, np.ndarray)):
        for compute in computations(model):
            with pytest.raises(ArgumentError):
                compute(angle)


@pytest.mark.parametrize("angle", [1.5, 3, np.float64(1.5), np.float32(1.5), np.int16(3)])
def test_a_step_takes_what_a_correction_takes(model, angle):
    step = model.compensator()
    expected = model.correct(float(angle), **SIGNALS)
    # Signals are taken by every model, needed or not.
    assert step(angle, torque=2.0, direction=1) == pytest.approx(expected, rel=ROUNDING)
    assert model.correct(angle, **SIGNALS) == pytest.approx(expected, abs=1e-6)
    with pytest.raises(TypeError):
        step(angle, speed=1.0)
    with pytest.raises(TypeError):
        step()


def test_steps_and_correctors_are_copied_with_their_state(model):
    angles = [1.0, 2.0, 1.99, 1.5]
    for made in (model.compensator(), model.corrector().step):
        again = pickle.loads(pickle.dumps(made))
        for angle in angles:
            assert again(angle, torque=1.0) == made(angle, torque=1.0)
    corrector = model.corrector()
    for angle in angles:
        corrector.step(angle, torque=1.0)
    for twin in (pickle.loads(pickle.dumps(corrector)), copy.deepcopy(corrector)):
        assert twin.state == pytest.approx(corrector.state, nan_ok=True)
        before = corrector.state
        twin.step(-50.0, torque=1.0)  # and goes its own way
        assert corrector.state == pytest.approx(before, nan_ok=True)


def test_a_corrected_step_does_not_share_its_copy():
    step = MODELS["backlash"].compensator()
    step(1.0)
    twin = pickle.loads(pickle.dumps(step))
    twin(50.0)
    assert step(0.99) == MODELS["backlash"].correct([1.0, 0.99])[-1]


def test_models_are_shown_in_one_line_and_summarised():
    orders = range(1, 500)
    wide = ta.HarmonicModel([ta.Shaft("o" * 200, 1, orders, [0.0] * 499, [0.0] * 499)])
    for model in (*MODELS.values(), wide):
        assert len(repr(model)) <= 160
        assert "\n" not in repr(model)
        assert model._repr_html_().startswith('<div class="trueangle">')
        assert len(model.summary().splitlines()) < 60
    assert "1080 " in MODELS["plain"].summary()  # 0.3 deg of order 1
    assert "&lt;" in wide.replace(shafts=[ta.Shaft("<b>", 1, [1], [0.0], [0.0])])._repr_html_()


def test_what_is_public_is_there_and_nothing_else_is_shown():
    assert issubclass(ta.errors.ArgumentError, ta.TrueAngleError)
    assert ta.terms.Backlash is ta.Backlash
    assert ta.plots.__name__ == "trueangle.plots"
    shown = dir(ta)
    assert {"fit", "TrueAngleError", "errors", "terms", "plots"} <= set(shown)
    assert not {"Any", "TYPE_CHECKING", "annotations", "importlib"} & set(shown)
    for name in shown:
        assert getattr(ta, name) is not None


# -- one door ---------------------------------------------------------------------------


def test_outputs_follow_the_same_rules_for_every_model(model):
    for dtype, kind in ((np.float64, np.float64), (np.float32, np.float32), (np.int32, np.float64)):
        x = np.arange(6, dtype=dtype).reshape(2, 3)
        for compute in computations(model):
            fresh = compute(x)
            assert (fresh.shape, fresh.dtype) == ((2, 3), kind)
            out = np.empty_like(fresh)
            assert compute(x, out=out) is out
            np.testing.assert_array_equal(out, fresh)
            strided = np.empty((4, 6), dtype=kind)[::2, ::2]
            assert compute(x, out=strided) is strided
            np.testing.assert_array_equal(strided, fresh)
            turned = compute(np.asfortranarray(x))  # in the order of the indices, not of memory
            np.testing.assert_array_equal(turned, fresh)
            for bad in (np.empty((2, 3), dtype=np.int64), np.empty(6, dtype=kind), [0.0] * 6):
                with pytest.raises(ArgumentError, match="out must"):
                    compute(x, out=bad)
            if dtype == kind:
                memory = np.zeros(8, dtype=dtype)
                with pytest.raises(ArgumentError, match="overlaps"):
                    compute(memory[:6], out=memory[2:])
                own = x.copy()
                assert compute(own, out=own) is own
                np.testing.assert_array_equal(own, fresh)


def test_signals_may_be_where_the_output_goes():
    model, torque = MODELS["torque"], np.linspace(-3.0, 3.0, 1000)
    x = np.linspace(0.0, 720.0, 1000)
    expected = model.correct(x, torque=torque.copy())
    np.testing.assert_array_equal(model.correct(x, torque, torque=torque), expected)


def test_the_span_is_guarded_by_every_path():
    base = partial(ta.HarmonicModel([SHAFT], 0.25, 360.0))
    inside, outside = np.full(300_000, 340.0), np.full(300_000, 200.0)
    both = np.concatenate([inside, outside])
    for terms in ((), (ta.TorsionalCompliance(0.01),), (ta.Backlash(0.01),)):
        for angles in (both, both.astype(np.float32), both.astype(np.int32)):
            model = base.replace(terms=terms)
            model.correct(angles[:300_000], torque=0.0)
            with pytest.warns(ta.errors.OutsideSpanWarning, match="300000 of 600000 corrected"):
                model.correct(angles, torque=0.0)
            model.correct(angles, torque=0.0)
