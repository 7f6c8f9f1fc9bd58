"""The transformer of scikit-learn: its own checks, and corrections that are known."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, NotCorrectedWarning

sklearn = pytest.importorskip("sklearn")

from sklearn.base import clone  # noqa: E402
from sklearn.model_selection import cross_val_score  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.utils.estimator_checks import check_estimator  # noqa: E402

from trueangle.fitting.sklearn import AngleCorrector  # noqa: E402

SEED = 5
#: Checks whose targets are classes or noise: no column follows them, and the fit says so.
NO_ANGLES = dict.fromkeys(
    (
        "check_dict_unchanged",
        "check_dont_overwrite_parameters",
        "check_dtype_object",
        "check_estimators_dtypes",
        "check_estimators_fit_returns_self",
        "check_estimators_overwrite_params",
        "check_f_contiguous_array_estimator",
        "check_fit2d_predict1d",
        "check_fit_idempotent",
        "check_methods_sample_order_invariance",
        "check_methods_subset_invariance",
        "check_n_features_in_after_fitting",
        "check_readonly_memmap_input",
    ),
    "the columns do not follow the target, which is refused",
)


def data(n=600):
    """True angle in any order and two encoders' readings of it, radians."""
    rng = np.random.default_rng(SEED)
    true = rng.uniform(-9.0, 9.0, n)
    first = true + 0.02 * np.sin(true) + 0.01 * np.cos(3.0 * true)
    second = true + 0.05 * np.cos(2.0 * true) + 1.0
    return np.column_stack([first, second]) + rng.normal(0.0, 1e-4, (n, 2)), true


def off(corrected, true):
    return np.std(ta.wrap(corrected - true[:, None], 2.0 * np.pi), axis=0)


@pytest.mark.filterwarnings("ignore")
def test_the_checks_of_scikit_learn():
    results = check_estimator(AngleCorrector(), expected_failed_checks=NO_ANGLES, on_fail=None)
    wrong = {r["check_name"] for r in results if r["status"] == "failed"}
    assert not wrong
    refused = [r for r in results if r["status"] == "xfail"]
    assert {r["check_name"] for r in refused} <= NO_ANGLES.keys()
    assert all("does not follow the reference" in str(r["exception"]) for r in refused)


def test_columns_are_corrected_and_named():
    x, true = data()
    corrector = AngleCorrector().fit(x, true)
    assert [model.orders for model in corrector.models_] == [(1, 3), (2,)]
    assert (off(x, true) > 0.01).all()
    assert (off(corrector.transform(x), true) < 1.5e-4).all()
    assert corrector.get_feature_names_out(["a", "b"]).tolist() == ["a", "b"]


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_frames_come_out_as_asked(library):
    module = pytest.importorskip(library)
    x, true = data()
    frame = module.DataFrame({"elbow": x[:, 0], "wrist": x[:, 1]})
    corrector = AngleCorrector(orders=[1, 2, 3]).fit(frame, true)
    out = corrector.set_output(transform=library).transform(frame)
    assert isinstance(out, module.DataFrame)
    assert list(out.columns) == ["elbow", "wrist"]
    assert corrector.feature_names_in_.tolist() == ["elbow", "wrist"]
    plain = AngleCorrector(orders=[1, 2, 3]).fit(x, true).transform(x)
    np.testing.assert_array_equal(out.to_numpy(), plain)


def test_on_angles_it_behaves_as_the_refused_checks_want():
    x, true = data()
    x.flags.writeable = True
    frozen = x.copy(order="F")
    frozen.flags.writeable = False
    corrector = AngleCorrector(orders=(1, 2, 3))
    before = corrector.get_params()
    assert corrector.fit(frozen, true) is corrector
    assert corrector.get_params() == before
    once = corrector.transform(frozen)
    order = np.random.default_rng(SEED).permutation(len(x))
    np.testing.assert_array_equal(corrector.transform(x[order]), once[order])
    np.testing.assert_array_equal(corrector.transform(x[:5]), once[:5])
    shuffled = clone(corrector).fit(x[order], true[order])
    np.testing.assert_allclose(shuffled.transform(x), once, rtol=0.0, atol=1e-12)
    with pytest.raises(ValueError, match="2 features"):
        corrector.transform(x[:, :1])


def test_pipelines_and_cross_validation():
    from sklearn.linear_model import LinearRegression

    x, true = data()
    x = x[:, :1]
    line = make_pipeline(AngleCorrector(orders=[1, 3]), LinearRegression())
    with_it, without = (
        cross_val_score(model, x, true, scoring="neg_mean_squared_error").mean()
        for model in (line, LinearRegression())
    )
    assert with_it > 0.01 * without  # both negative: a hundredth of the square error


def test_the_score_is_what_the_correction_takes_off():
    x, true = data()
    score = AngleCorrector(orders=[1, 2, 3]).fit(x, true).score(x, true)
    assert 0.99 < score <= 1.0
    # Of a model without the orders there are, on both columns: their share of the squares.
    first = AngleCorrector(orders=[1]).fit(x, true).score(x, true)
    assert first == pytest.approx(0.5 * 0.02**2 / (0.02**2 + 0.01**2), abs=0.05)
    assert (cross_val_score(AngleCorrector(orders=[1, 2, 3]), x, true) > 0.99).all()
    # What has no error keeps none, whatever the zero.
    plain = AngleCorrector(orders=[1]).fit(true[:, None] + 2.0, true)
    assert plain.score(true[:, None] + 2.0, true) == pytest.approx(1.0)


def test_what_is_no_angle_is_refused_and_nothing_is_made_of_noise():
    x, true = data()
    with pytest.raises(ArgumentError, match="does not follow"):
        AngleCorrector().fit(3.7 * x, true)
    rng = np.random.default_rng(SEED)
    plain = true[:, None] + rng.normal(0.0, 0.01, (len(true), 1))
    with pytest.warns(NotCorrectedWarning, match="left as it is"):
        corrector = AngleCorrector().fit(plain, true)
    assert corrector.models_ == [None]
    np.testing.assert_array_equal(corrector.transform(plain), plain)


def test_true_angles_are_asked_for():
    assert AngleCorrector().__sklearn_tags__().target_tags.required
