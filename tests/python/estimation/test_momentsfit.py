"""What is found from sums: against the slow truth, in every unit, in any order of the readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.errors import ArgumentError
from trueangle.estimation import reference
from trueangle.estimation.moments import Moments

UNITS = (360.0, 2.0 * math.pi, 1.0, 4096.0)
SHAFTS = {"output": [1, 3], "motor": [2]}


def rows(period: float, seed: int = 1, n: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-1.0, 2.0, n)
    x = 2.0 * math.pi * turns
    error = 0.2 * np.cos(x) - 0.1 * np.sin(3 * x) + 0.03 * np.sin(2 * 20.5 * x)
    error += rng.normal(0.0, 0.01, n)
    return turns * period, error * period / 360.0, rng.integers(0, 4, n).astype(float)


def sums(period: float, seeds: tuple[int, ...] = (1, 2), weighted: bool = True) -> Moments:
    found = Moments(SHAFTS, period=period, gear_ratio=20.5)
    for seed in seeds:
        theta, error, weights = rows(period, seed)
        found.update(theta, error + seed * period / 9.0, weights if weighted else None, run=seed)
    return found


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("weighted", [True, False])
def test_sums_give_the_slow_fit_in_every_unit(period: float, weighted: bool) -> None:
    fit = sums(period, weighted=weighted).solve()
    runs = []
    for seed in (1, 2):
        theta, error, weights = rows(period, seed)
        runs.append(
            CalibrationRun(
                theta,
                theta + error + seed * period / 9.0,
                period,
                weights=weights if weighted else None,
            )
        )
    slow = reference.fit(runs, [(1.0, [1, 3]), (20.5, [2])])
    scale = period / 360.0
    pairs = np.column_stack([fit.cosine, fit.sine]).ravel()
    np.testing.assert_allclose(pairs / scale, slow.coefficients / scale, atol=1e-9)
    np.testing.assert_allclose(
        fit.covariance[1:, 1:] / scale**2, slow.covariance / scale**2, rtol=1e-6, atol=1e-14
    )
    np.testing.assert_allclose(list(fit.offsets.values()), slow.offsets, atol=1e-9 * period)
    assert fit.orders == (1, 3, 2)
    np.testing.assert_allclose(fit.amplitudes, np.hypot(fit.cosine, fit.sine))
    x = np.linspace(0.0, 6.0, 9)
    for a, b, c, phi in zip(fit.cosine, fit.sine, fit.amplitudes, fit.phases, strict=True):
        np.testing.assert_allclose(a * np.cos(x) + b * np.sin(x), c * np.sin(x + phi))
    np.testing.assert_allclose(fit.std**2, np.diag(fit.covariance))
    assert fit.constant / period == pytest.approx(1.5 / 9.0, abs=1e-4)
    readings = sum(np.count_nonzero(rows(period, s)[2]) if weighted else 400 for s in (1, 2))
    assert fit.degrees_of_freedom == readings - 8
    residual = slow.residuals / scale
    weights = np.concatenate([rows(period, s)[2] for s in (1, 2)]) if weighted else np.ones(800)
    variance = float(weights @ residual**2) / (readings - 8)
    assert fit.residual_variance / scale**2 == pytest.approx(variance, rel=1e-6)
    given = fit.model("indicated")
    assert (given.argument, given.period, given.constant) == ("indicated", period, fit.constant)
    np.testing.assert_array_equal(given.covariance, fit.covariance)
    assert given.condition_number == fit.condition_number
    theta = rows(period)[0]
    wanted = (
        fit.constant
        + reference.design_matrix(theta, [(1.0, [1, 3]), (20.5, [2])], period, constant=False)
        @ pairs
    )
    np.testing.assert_allclose(given.error(theta), wanted, atol=1e-9 * period)


def test_neither_order_nor_splitting_nor_copying_changes_what_is_found() -> None:
    whole = sums(360.0).solve()
    order = np.random.default_rng(9).permutation(400)
    other = Moments(SHAFTS, period=360.0, gear_ratio=20.5)
    parts = [Moments(SHAFTS, period=360.0, gear_ratio=20.5) for _ in range(3)]
    for seed in (2, 1):
        theta, error, weights = rows(360.0, seed)
        error = error + seed * 40.0
        other.update(theta[order], error[order], weights[order], run=seed)
        for k, part in enumerate(parts):
            part.update(theta[k::3], error[k::3], weights[k::3], run=seed)
    before = parts[0].count
    merged = parts[0] + parts[1] + parts[2]
    assert parts[0].count == before
    copied = merged.copy()
    copied.update([1.0, 2.0], [0.0, 0.0], run="more")
    assert merged.runs == (2, 1)
    assert copied.runs == (2, 1, "more")
    for found in (other.solve(), merged.solve()):
        np.testing.assert_allclose(found.cosine, whole.cosine, atol=1e-12)
        np.testing.assert_allclose(found.covariance, whole.covariance, rtol=1e-8, atol=1e-16)
        for run in (1, 2):
            assert found.offsets[run] == pytest.approx(whole.offsets[run], abs=1e-10)
            assert found.offset_std[run] == pytest.approx(whole.offset_std[run], rel=1e-8)
        assert found.residual_variance == pytest.approx(whole.residual_variance, rel=1e-9)
    merged += parts[0]
    assert merged.count == copied.count - 2 + before
    with pytest.raises(ArgumentError, match="there is no run 'x'; the runs are \\[2, 1\\]"):
        merged.spectrum("x")
    # Twice 20.5 turns of the motor is a whole order of the output.
    assert merged.cycles == 1.0


def test_fading_readings_are_weighted_ones() -> None:
    """Each reading counts 0.99 of the one after it; pieces of a log are the log."""
    theta, error, weights = rows(360.0)
    once = Moments([1, 3], period=360.0, forgetting=0.99).update(theta, error, weights)
    pieces = Moments([1, 3], period=360.0, forgetting=0.99)
    for part in np.array_split(np.arange(400), 7):
        pieces.update(theta[part], error[part], weights[part])
    faded = weights * 0.99 ** np.arange(399.0, -1.0, -1.0)
    plain = Moments([1, 3], period=360.0).update(theta, error, faded).solve()
    a, b = once.solve(), pieces.solve()
    np.testing.assert_allclose(a.cosine, b.cosine, atol=1e-12)
    np.testing.assert_allclose(a.cosine, plain.cosine, atol=1e-12)
    effective = faded.sum() ** 2 / (faded @ faded) - 5.0
    share = plain.degrees_of_freedom / effective
    for found in (a, b):
        assert found.degrees_of_freedom == pytest.approx(effective, rel=1e-9)
        np.testing.assert_allclose(found.covariance, share * plain.covariance, rtol=1e-9)
        assert found.offset_std[None] == pytest.approx(math.sqrt(share) * plain.offset_std[None])
        squares = plain.residual_variance * plain.degrees_of_freedom
        freed = faded.sum() - 5.0 * (faded @ faded) / faded.sum()
        assert found.residual_variance == pytest.approx(squares / freed, rel=1e-9)
    # Nothing is forgotten at 1.
    kept = Moments([1, 3], period=360.0, forgetting=1.0).update(theta, error).solve()
    never = Moments([1, 3], period=360.0).update(theta, error).solve()
    np.testing.assert_allclose(kept.covariance, never.covariance, rtol=1e-9)
    for wrong in (0.0, 1.0001, -0.5):
        with pytest.raises(ArgumentError, match="forgetting must lie above 0 and at most at 1"):
            Moments([1], forgetting=wrong)


@pytest.mark.parametrize("seed", [4101])
def test_stated_errors_hold(seed: int) -> None:
    print("seed", seed)
    rng = np.random.default_rng(seed)
    pulls = []
    for _ in range(200):
        theta = rng.uniform(0.0, 300.0, 60)
        error = 0.2 * np.cos(np.radians(theta)) + rng.normal(0.0, 0.01, 60)
        fit = Moments([1, 2], period=360.0).update(theta, error).solve()
        truth = np.array([0.0, 0.2, 0.0, 0.0, 0.0])
        found = np.concatenate([[fit.constant], np.column_stack([fit.cosine, fit.sine]).ravel()])
        assert fit.offset_std[None] == pytest.approx(fit.std[0])
        pulls.append((found - truth) / fit.std)
    np.testing.assert_allclose(np.mean(pulls, axis=0), 0.0, atol=0.25)
    assert 0.93 < np.std(pulls) < 1.1
