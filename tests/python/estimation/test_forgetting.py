"""Moments that forget, and windows taken away again."""

import pickle

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError

SEED = 53_201


@pytest.fixture
def columns():
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    theta = rng.uniform(0.0, 360.0, 600)
    return theta, 0.3 * np.cos(np.radians(theta)) + rng.normal(0.0, 0.1, theta.size)


def test_forgetting_is_least_squares_with_fading_weights(columns):
    theta, error = columns
    moments = ta.Moments([1, 2], period=360.0, forgetting=0.99)
    for start in range(0, 600, 57):
        moments.update(theta[start : start + 57], error[start : start + 57])
    weights = 0.99 ** np.arange(599.0, -1.0, -1.0)
    design = np.column_stack(
        [np.ones(600), *(f(k * np.radians(theta)) for k in (1, 2) for f in (np.cos, np.sin))]
    )
    root = np.sqrt(weights)
    slow = np.linalg.lstsq(design * root[:, None], error * root, rcond=None)[0]
    found = moments.solve()
    assert found.cosine == pytest.approx(slow[[1, 3]], abs=1e-12)
    assert found.sine == pytest.approx(slow[[2, 4]], abs=1e-12)
    effective = weights.sum() ** 2 / (weights @ weights)
    assert found.degrees_of_freedom == pytest.approx(effective - 5.0)
    assert found.residual_variance == pytest.approx(0.01, rel=0.3)
    again = pickle.loads(pickle.dumps(moments)).solve()
    assert (again.cosine == found.cosine).all()
    assert moments.copy().solve().degrees_of_freedom == found.degrees_of_freedom


def test_its_standard_errors_hold():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    pulls = []
    for _ in range(300):
        theta = rng.uniform(0.0, 360.0, 400)
        moments = ta.Moments([1], period=360.0, forgetting=0.98)
        moments.update(theta, rng.normal(0.0, 1.0, 400))
        found = moments.solve()
        pulls.append(found.cosine[0] / np.sqrt(found.covariance[1, 1]))
    assert np.std(pulls) == pytest.approx(1.0, abs=0.12)


def test_a_window_taken_away_leaves_the_others(columns):
    theta, error = columns
    parts = [ta.Moments([1, 2], period=360.0) for _ in range(3)]
    for part, x, e in zip(parts, np.split(theta, 3), np.split(error, 3), strict=True):
        part.update(x, e)
    whole = parts[0] + parts[1] + parts[2]
    left = whole.subtract(parts[0]).solve()
    wanted = (parts[1] + parts[2]).solve()
    assert left.cosine == pytest.approx(wanted.cosine, abs=1e-12)
    assert left.residual_variance == pytest.approx(wanted.residual_variance, rel=1e-9)
    assert left.degrees_of_freedom == wanted.degrees_of_freedom
    assert whole.subtract(parts[1] + parts[2]).count == 0
    assert not whole.runs


def test_what_was_not_added_is_not_taken_away(columns):
    theta, error = columns
    one = ta.Moments([1], period=360.0).update(theta, error)
    with pytest.raises(ArgumentError, match="orders, shafts and period"):
        one.subtract(ta.Moments([2], period=360.0))
    with pytest.raises(ArgumentError, match="was not added"):
        one.subtract(ta.Moments([1], period=360.0).update(theta, error, run="b"))
    fading = ta.Moments([1], period=360.0, forgetting=0.9).update(theta, error)
    with pytest.raises(ArgumentError, match="forget"):
        one.subtract(fading)
    with pytest.raises(ArgumentError, match="forget"):
        one.merge(fading)
    with pytest.raises(ArgumentError, match="forgetting must lie"):
        ta.Moments([1], forgetting=0.0)
    with pytest.raises(ArgumentError, match="other must be"):
        one.subtract(3)
