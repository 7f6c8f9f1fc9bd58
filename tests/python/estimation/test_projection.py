"""Fits under any noise and what candidates save, against generalised least squares in full."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle._core import Factor
from trueangle.effects.search import golden_maximum
from trueangle.estimation.blocks import BlockProducts, Blocks
from trueangle.estimation.factor import orthonormal_basis
from trueangle.estimation.projection import Projection, project
from trueangle.estimation.solution import common_blocks
from trueangle.estimation.whitening import RunEffect, Whitener
from trueangle.joint.pattern import line_columns

from .dense import BOUNDS, CASES, N, case, covariance


def gls(x: np.ndarray, y: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients, and squares left, by the inverse of the covariance."""
    inverse = np.linalg.inv(v)
    found = np.linalg.pinv(x.T @ inverse @ x) @ x.T @ inverse @ y
    left = y - x @ found
    return found, float(left @ inverse @ left)


def fitted(kind: tuple, seed: int = 20) -> tuple[Projection, np.ndarray, np.ndarray, np.ndarray]:
    whiten = case(*kind)
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.ones(N), rng.normal(size=(N, 3))])
    y = x @ [1.0, 2.0, -1.0, 0.5] + rng.normal(size=N)
    return project(Factor(whiten, x), y), x, y, covariance(whiten)


@pytest.mark.parametrize("kind", CASES)
def test_a_fit_is_generalised_least_squares(kind: tuple) -> None:
    found, x, y, v = fitted(kind)
    coefficients, rss = gls(x, y, v)
    np.testing.assert_allclose(found.coefficients, coefficients, atol=1e-9)
    assert found.rss == pytest.approx(rss, rel=1e-9)
    assert found.n == N
    assert found.variance == pytest.approx(rss / (N - 4), rel=1e-9)
    inverse = np.linalg.inv(x.T @ np.linalg.inv(v) @ x)
    np.testing.assert_allclose(found.unscaled_covariance, inverse, atol=1e-9)
    # Twice the likelihood's logarithm with its sigma put in, but for constants of n.
    expected = N * np.log(rss / N) + np.linalg.slogdet(v)[1]
    assert found.deviance == pytest.approx(expected, abs=1e-8)
    assert not found.is_explained
    assert found.of_target(x @ np.ones(4)).is_explained
    other = np.random.default_rng(2).normal(size=N)
    again = found.of_target(other)
    np.testing.assert_allclose(again.coefficients, gls(x, other, v)[0], atol=1e-9)
    assert again.rss == pytest.approx(gls(x, other, v)[1], rel=1e-9)


@pytest.mark.parametrize("kind", CASES)
def test_what_candidates_save_is_what_a_fit_with_them_saves(kind: tuple) -> None:
    found, x, y, v = fitted(kind)
    rng = np.random.default_rng(21)
    blocks = [rng.normal(size=(N, width)) for width in (1, 2, 2, 3)]
    blocks.append(np.column_stack([blocks[1], x[:, 1]]))  # one of them is fitted already

    def saved(columns: np.ndarray) -> float:
        return N * np.log(found.rss / gls(np.hstack([x, columns]), y, v)[1])

    gains = found.block_gains(Blocks(blocks))
    for block, gain in zip(blocks[:4], gains, strict=False):
        alone, coefficients = found.gain(block)
        assert alone == pytest.approx(saved(block), abs=1e-7)
        assert gain == pytest.approx(alone, abs=1e-7)
        wanted = gls(np.hstack([x, block]), y, v)[0][4:]
        np.testing.assert_allclose(coefficients, wanted, atol=1e-8)
        for k, single in enumerate(found.gains(block)):
            assert single == pytest.approx(saved(block[:, [k]]), abs=1e-7)
        for k, fixed in enumerate(found.fixed_gains(block)):
            less = gls(x, y - block[:, k], v)[1]
            assert fixed == pytest.approx(N * np.log(found.rss / less), abs=1e-7)
    assert found.gain(blocks[4])[0] == gains[4] == 0.0
    assert not found.gain(blocks[4])[1].any()
    assert found.gains(x).tolist() == found.fixed_gains(x).tolist() == [0.0] * 4
    assert found.as_deviances(0.25 * found.rss) == pytest.approx(-N * np.log(0.75))
    pairs = np.hstack(blocks[1:3]).astype(np.float32)
    np.testing.assert_allclose(found.pair_gains(BlockProducts(pairs, 2)), gains[1:3], rtol=2e-3,
                               atol=2e-3)  # fmt: skip
    seen, residual = found.seen
    mapped = found.whiten(blocks[3])
    np.testing.assert_allclose(residual @ blocks[3], found.r @ mapped, atol=1e-10)
    np.testing.assert_allclose(seen @ blocks[3], found.q.T @ mapped, atol=1e-10)


@pytest.mark.parametrize("kind", CASES)
def test_columns_fitted_too_leave_scores_of_the_whole_fit(kind: tuple) -> None:
    found, x, y, v = fitted(kind)
    further, candidate = np.random.default_rng(22).normal(size=(2, N, 2))
    joint = found.jointly_with(further)
    both = np.hstack([x, further])
    assert joint.rss == pytest.approx(gls(both, y, v)[1], rel=1e-9)
    saved = N * np.log(joint.rss / gls(np.hstack([both, candidate]), y, v)[1])
    assert joint.gain(candidate)[0] == pytest.approx(saved, abs=1e-7)
    projected, excited = found.projected(np.column_stack([further, x[:, 2]]))
    assert excited.tolist() == [True, True, False]
    np.testing.assert_allclose(found.q.T @ projected, 0.0, atol=1e-10)
    # Believed to be small: the coefficients' own variance is part of the covariance.
    spread = 0.4
    partly = found.jointly_with(further, spread)
    wide = v + spread**2 / found.variance * further @ further.T
    one = candidate[:, :1]
    a, b = gls(x, y, wide), gls(np.hstack([x, one]), y, wide)
    _, coefficients = partly.gain(one)
    assert coefficients[0] == pytest.approx(b[0][4], abs=1e-8)
    assert a[1] > b[1]


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("size", [0.0, 0.5, 3.0])
def test_the_best_ratio_of_a_run_effect_is_that_of_the_likelihood(kind: tuple, size: float) -> None:
    found, x, y, v = fitted(kind)
    rng = np.random.default_rng(23)
    z = rng.normal(size=(N, 2))
    shift = np.zeros(N)
    for a, b in BOUNDS:
        shift[a:b] = size * z[a:b] @ rng.normal(size=2)
    found = found.of_target(y + shift)

    def saved(ratio: float) -> float:
        wide = v.copy()
        for a, b in BOUNDS:
            wide[a:b, a:b] += ratio * z[a:b] @ z[a:b].T
        likelihood = N * np.log(gls(x, y + shift, wide)[1] / found.rss)
        return -likelihood - np.linalg.slogdet(wide)[1] + np.linalg.slogdet(v)[1]

    ratio, deviance = found.ratio_of(z)
    # Column by column as well.
    assert found.ratio_of(np.asfortranarray(z)) == pytest.approx((ratio, deviance), rel=1e-12)
    scan = max((saved(t), t) for t in np.geomspace(1e-4, 1e4, 400))
    assert deviance == pytest.approx(max(scan[0], 0.0), abs=0.02)
    if ratio > 0.0:
        assert saved(ratio) == pytest.approx(deviance, abs=1e-6)
        assert deviance > scan[0] - 0.02
    else:
        assert scan[0] < 0.02


def test_many_columns_have_their_ratio_as_few_have() -> None:
    """Fifty runs of one column each: more than one eigensystem is made for."""
    rng = np.random.default_rng(24)
    bounds = [(8 * k, 8 * k + 8) for k in range(50)]
    y = rng.normal(size=400) + np.repeat(rng.normal(size=50), 8) * 0.7
    factor = Factor(Whitener(bounds, 0.0, []), np.ones((400, 1)))
    ratio, _ = project(factor, y).ratio_of(np.ones((400, 1)))
    # Of equal runs the likelihood has a closed form: variance between over that within.
    means = y.reshape(50, 8).mean(axis=1)
    within = ((y - np.repeat(means, 8)) ** 2).sum() / 350.0
    between = ((means - y.mean()) ** 2).sum() / 50.0
    assert ratio == pytest.approx((between - within / 8.0) / within, rel=0.02)


def test_a_long_run_is_one_however_many_of_its_readings_are_held_at_once() -> None:
    rng = np.random.default_rng(26)
    factor = Factor(Whitener([(0, 900)], 0.9, []), np.ones((900, 1)))
    found = project(factor, rng.normal(size=900))
    columns = np.cumsum(rng.normal(size=(900, 3)), axis=0)
    x, _ = found.projected(columns)
    expected = np.linalg.lstsq(x, found.r, rcond=None)[0]
    np.testing.assert_allclose(found.gain(columns)[1], expected, rtol=1e-9)


@pytest.mark.parametrize("kind", CASES)
def test_a_factor_is_the_mapped_columns_by_their_singular_values(kind: tuple) -> None:
    rng = np.random.default_rng(25)
    whiten = case(*kind)
    blocks = [rng.normal(size=(N, 6)), rng.normal(size=(N, 2)) * 1e3, rng.normal(size=(N, 1))]
    blocks.append(blocks[0][:, :1] + 1e-7 * rng.normal(size=(N, 1)))  # all but fitted already
    blocks.append(blocks[0][:, 1:2] + 1e-2 * rng.normal(size=(N, 1)))
    blocks.append(np.zeros((N, 1)))
    y = rng.normal(size=N)
    for chosen in ((0, 1), (0, 2), (0, 3), (0, 1, 4), (1, 0, 5), (2, 3, 0, 4, 5)):
        design = np.hstack([blocks[k] for k in chosen])
        x = whiten(design)
        lengths = np.linalg.norm(x, axis=0).clip(1e-300)
        u, s, vt = np.linalg.svd(x / lengths, full_matrices=False)
        kept = s > 1e-7 * s[0]
        factor = Factor(whiten, design)
        assert factor.rank == factor.q.shape[1] == kept.sum()
        np.testing.assert_allclose(factor.q.T @ factor.q, np.eye(factor.rank), atol=1e-10)
        found = factor.coefficients(y)
        slow = vt[kept].T @ ((u[:, kept].T @ whiten(y)) / s[kept]) / lengths
        scale = np.maximum(np.abs(slow), 1e-3)
        np.testing.assert_allclose(found / scale, slow / scale, atol=1e-6)
        again, r, squares = factor.project(y)
        np.testing.assert_array_equal(again, found)
        np.testing.assert_allclose(r, whiten(y - design @ slow), atol=1e-8)
        assert squares == pytest.approx(r @ r)
        # X B is Q.
        np.testing.assert_allclose(x @ factor.back, factor.q, atol=1e-6)
    assert Factor(whiten, blocks[0][:, ::2]).design.flags.f_contiguous


def test_blocks_in_common() -> None:
    blocks = [np.zeros((3, k)) for k in range(4)]
    assert common_blocks(blocks, [*blocks[:2], blocks[0]]) == 2
    assert common_blocks(blocks, blocks[:3]) == 3
    assert common_blocks(blocks[1:], blocks) == 0


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_a_line_that_every_run_draws_anew_is_the_best_of_golden_sections(rho: float) -> None:
    rng = np.random.default_rng(28)
    bounds = [(0, 200), (200, 380)]
    angles = np.cumsum(rng.uniform(0.0, 0.1, 380))
    phase = np.repeat([0.3, 2.0], [200, 180])
    y = np.sin(3.3 * angles + phase) + 0.2 * rng.normal(size=380)
    found = project(Factor(Whitener(bounds, rho), np.ones((380, 1))), y)

    def saved(order: float) -> float:
        return found.ratio_of(line_columns(angles, order))[1]

    place, value = golden_maximum(saved, 3.1, 3.5, 10)
    order, deviance = found.drawn_line(angles, 3.1, 3.5, 10)
    assert order == place
    assert deviance == value == saved(order)
    assert order == pytest.approx(3.3, abs=0.02)


def test_columns_that_are_alike_share_what_they_explain() -> None:
    x = np.column_stack([np.ones(N), np.arange(N), np.arange(N), np.zeros(N)])
    y = 2.0 + 3.0 * np.arange(N)
    found = project(Factor(Whitener(BOUNDS, 0.0, []), x), y)
    np.testing.assert_allclose(found.coefficients, [2.0, 1.5, 1.5, 0.0], atol=1e-9)
    assert found.q.shape == (N, 2)
    for columns in (x[:, :3], x[:, :2]):
        basis = orthonormal_basis(columns)
        assert basis.shape == (N, 2)
        np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-12)
        np.testing.assert_allclose(basis @ (basis.T @ y), y, atol=1e-9)


@pytest.mark.parametrize(("apart", "rank"), [(1e-9, 1), (3e-7, 2), (1e-3, 2), (0.3, 2)])
def test_columns_that_are_nearly_alike(apart: float, rank: int) -> None:
    rng = np.random.default_rng(26)
    one, other = np.linalg.qr(rng.normal(size=(N, 2)))[0].T
    x = np.column_stack([one, one + apart * other])
    found = project(Factor(Whitener(BOUNDS, 0.0, []), x), 2.0 * one + 3.0 * other)
    assert found.q.shape[1] == rank
    np.testing.assert_allclose(found.q.T @ found.q, np.eye(rank), atol=1e-12)
    if rank == 2:
        np.testing.assert_allclose(found.coefficients[1] * apart, 3.0, rtol=1e-6)


def test_scores_allow_for_a_run_effect_that_is_fitted() -> None:
    effect = RunEffect(np.ones((N, 1)), 1e12)
    factor = Factor(Whitener(BOUNDS, 0.0, [effect]), np.ones((N, 1)))
    column = np.repeat([1.0, 2.0, 5.0], [20, 2, 18])[:, None]
    # A step between runs is what the effect draws: it saves nothing.
    assert project(factor, np.random.default_rng(1).normal(size=N)).gain(column)[0] < 1e-3
    assert isinstance(factor.whiten, Whitener)


@pytest.mark.parametrize("kind", CASES)
def test_columns_that_tell_little_of_most_readings_are_scored_alike(kind: tuple) -> None:
    found, *_ = fitted(kind)
    columns = np.random.default_rng(24).normal(size=(N, 3))
    columns[:13] = columns[31:] = 0.0
    columns[:, 1] = 0.0
    for some in (columns[:, :1], columns[:, :2], columns):
        mapped = found.whiten(some)
        left = mapped - found.q @ (found.q.T @ mapped)
        powers = found.beside.powers(np.ascontiguousarray(some))
        wanted = np.sum(mapped**2, axis=0), np.sum(left * mapped, axis=0), found.r @ mapped
        for got, expected in zip(powers, wanted, strict=True):
            np.testing.assert_allclose(got, expected, atol=1e-11)
    columns[20, 1] = np.nan
    assert np.isnan(found.gains(columns[:, 1:2])).all() or not found.gains(columns[:, 1:2]).any()


@pytest.mark.parametrize("kind", CASES)
def test_no_bump_near_the_one_found_saves_more(kind: tuple) -> None:
    found, _, y, _ = fitted(kind)
    phase = np.linspace(-100.0, 250.0, N)

    def bump(place: float, width: float) -> np.ndarray:
        return np.exp(-0.5 * ((phase - place) / width) ** 2)

    found = found.of_target(y + 9.0 * bump(61.0, 24.0))
    place, width = found.beside.bump(phase, 66.0, 20.0, 80.0)
    best = found.gains(bump(place, width)[:, None])[0]
    assert best > found.gains(bump(66.0, 20.0)[:, None])[0]
    for step in (-0.02, 0.02):
        beside = [bump(place + step * width, width), bump(place, width * (1.0 + step))]
        assert (found.gains(np.column_stack(beside)) < best).all()
    # A turn further on is the same place.
    again = found.beside.bump(phase + 720.0, 66.0, 20.0, 80.0)
    assert again == pytest.approx((place, width), rel=1e-6)
    assert found.beside.bump(phase, 66.0, 20.0, 18.0)[1] <= 18.0 * (1.0 + 1e-12)
    with pytest.raises(ValueError, match="phase"):
        found.beside.bump(phase[:-1], 66.0, 20.0, 80.0)
