"""`Moments`: one pass, any subset of orders, merging, pickling."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.errors import ArgumentError, RankError

ROUNDING = 1e-13  # relative to errors of a degree or so


def readings(seed, size, zero=0.0):
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-720, 720, size)
    error = zero + np.cos(np.radians(theta)) + 0.2 * np.sin(5 * np.radians(theta))
    return theta, error + 0.01 * rng.normal(size=size), rng.uniform(0.5, 2, size)


def test_any_subset_is_the_fit_of_that_subset():
    theta, error, weights = readings(1, 5000, zero=-109.4)
    moments = ta.Moments(range(1, 21), period=360.0)
    for part in np.array_split(np.arange(5000), 7):
        moments.update(theta[part], error[part], weights[part])
    for orders in ([1, 5], [1], list(range(1, 21)), [3, 20]):
        found = moments.solve(orders)
        plain = _core.fit([(theta, theta + error, weights)], 360.0, [1.0], [orders], method="plain")
        assert found.orders == tuple(orders)
        assert found.cosine == pytest.approx(plain.cosine[0], abs=ROUNDING)
        assert found.sine == pytest.approx(plain.sine[0], abs=ROUNDING)
        assert found.constant == pytest.approx(plain.constant, abs=1000 * ROUNDING)
        assert found.residual_variance == pytest.approx(plain.residual_variance, rel=1e-9)
        assert found.covariance == pytest.approx(plain.covariance, rel=1e-9, abs=1e-15)
        assert found.degrees_of_freedom == plain.degrees_of_freedom
        assert found.std == pytest.approx(np.sqrt(np.diag(plain.covariance)), rel=1e-9)
    assert moments.solve([1, 5]).amplitudes == pytest.approx([1, 0.2], abs=0.01)
    assert moments.solve([1, 5]).phases == pytest.approx([np.pi / 2, 0], abs=0.01)
    model = moments.solve([1, 5]).model()
    assert model.correct(model.error(10.0) + 10.0) == pytest.approx(10.0, abs=1e-12)


def test_runs_have_zeros_of_their_own_wherever_they_are_merged():
    zeros = {"a": 179.5, "b": -109.4, "c": 3.0}
    moments, parts = ta.Moments([1, 5], period=360.0), []
    for index, (label, zero) in enumerate(zeros.items()):
        theta, error, weights = readings(index, 900, zero)
        moments.update(theta, error, weights, run=label)
        halves = [ta.Moments([1, 5], period=360.0) for _ in range(2)]
        # Whole turns and the place of the cut do not matter.
        halves[0].update(theta[:300], error[:300] + 360.0, weights[:300], run=label)
        halves[1].update(theta[300:], error[300:] % 360.0, weights[300:], run=label)
        parts += halves
    whole = moments.solve()
    for order in (parts, parts[::-1]):
        merged = sum(order[1:], order[0]).solve()
        assert merged.cosine == pytest.approx(whole.cosine, abs=100 * ROUNDING)
        assert merged.sine == pytest.approx(whole.sine, abs=100 * ROUNDING)
        assert merged.residual_variance == pytest.approx(whole.residual_variance, rel=1e-7)
        for label, zero in zeros.items():
            assert whole.offsets[label] == pytest.approx(zero, abs=0.01)
            assert merged.offsets[label] == pytest.approx(whole.offsets[label], abs=1e-10)
            assert merged.offset_std[label] == pytest.approx(whole.offset_std[label], rel=1e-7)


def test_pickle_and_copy_keep_every_bit():
    moments = ta.Moments({"output": [1, 2], "motor": [1]}, period=360.0, gear_ratio=100.0)
    moments.update(*readings(4, 3000)[:2], run=7)
    again = pickle.loads(pickle.dumps(moments))
    copy = moments.copy()
    for other in (again, copy):
        assert other.runs == (7,)
        assert other.count == 3000
        ours, theirs = moments.spectrum(7), other.spectrum(7)
        assert ours.weight.tolist() == theirs.weight.tolist()
        assert ours.error.tolist() == theirs.error.tolist()
    copy.update([1.0], [2.0])
    assert (moments.count, copy.count) == (3000, 3001)
    assert [s.name for s in again.solve().shafts] == ["output", "motor"]


def test_spectrum_is_what_it_says():
    theta, error, weights = readings(5, 2000)
    moments = ta.Moments([1, 30], period=360.0).update(theta, error, weights)
    spectrum = moments.spectrum()
    k = np.arange(61)[:, None]
    waves = np.exp(1j * k * np.radians(theta))
    assert spectrum.cycles == 1.0
    assert spectrum.weight == pytest.approx(waves @ weights, abs=1e-10)
    y = error - spectrum.centre
    assert spectrum.error == pytest.approx(waves[:31] @ (weights * y), abs=1e-10)
    assert spectrum.squares == pytest.approx(weights @ y**2, rel=1e-12)
    assert spectrum.samples == 2000


def test_partial_travel_is_solved_by_factors():
    rng = np.random.default_rng(6)
    theta = rng.uniform(0, 180, 30_000)
    error = np.cos(np.radians(theta)) + 0.1 * np.sin(8 * np.radians(theta))
    found = ta.Moments(range(1, 9), period=360.0).update(theta, error).solve()
    assert found.method == "qr"
    # Condition number 6e5: the sums themselves would leave four digits.
    assert found.cosine == pytest.approx([1, 0, 0, 0, 0, 0, 0, 0], abs=1e-8)
    assert found.sine == pytest.approx([0, 0, 0, 0, 0, 0, 0, 0.1], abs=1e-8)


def test_rank_deficiency_names_the_orders():
    theta = np.tile(np.arange(36) * 10.0, 100)
    moments = ta.Moments([1, 16, 18, 20], period=360.0)
    moments.update(theta, np.cos(np.radians(theta)))
    with pytest.raises(RankError, match="sine of order 18 is zero"):
        moments.solve([1, 18])
    with pytest.raises(RankError, match="order 20 cannot be distinguished from order 16"):
        moments.solve([16, 20])
    assert moments.solve([1, 16]).cosine == pytest.approx([1, 0], abs=1e-12)


def test_bad_arguments():
    moments = ta.Moments([1, 2], period=360.0)
    for arguments, message in [
        (([1.0], [1.0, 2.0]), r"error has shape \(2,\), theta has \(1,\)"),
        (([1.0], [np.nan]), r"error\[0\] must be finite"),
        (([np.inf], [1.0]), r"theta\[0\] must be finite"),
        (([1.0], [1.0], [-1.0]), r"weights\[0\]"),
    ]:
        with pytest.raises(ArgumentError, match=message):
            moments.update(*arguments)
    with pytest.raises(RankError, match="no runs"):
        moments.solve()
    with pytest.raises(ArgumentError, match="no run 'x'"):
        moments.spectrum("x")
    with pytest.raises(ArgumentError, match="not accumulated"):
        moments.update(0.0, 0.0).solve([3])
    with pytest.raises(ArgumentError, match="merge only if"):
        moments.merge(ta.Moments([1, 3], period=360.0))
    with pytest.raises(ArgumentError, match="together"):
        ta.Moments({"output": [1], "motor": [1]}, gear_ratio=16 * np.pi)
