"""Columns that are nearly fitted already, or nearly alike: from both sides of each limit."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle._core import Factor
from trueangle.estimation.blocks import BlockProducts, Blocks
from trueangle.estimation.projection import Projection, project
from trueangle.estimation.whitening import Whitener

SEED = 52_900
N = 64


def basis() -> np.ndarray:
    """Orthonormal columns."""
    print("seed", SEED)
    return np.linalg.qr(np.random.default_rng(SEED).normal(size=(N, 8)))[0]


def fitted(columns: np.ndarray, y: np.ndarray, rho: float = 0.0) -> Projection:
    return project(Factor(Whitener([(0, 24), (24, N)], rho, []), columns), y)


def between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """A unit column of which ``other`` has that share of the power, and ``one`` the rest."""
    return np.asarray(np.sqrt(1.0 - share) * one + np.sqrt(share) * other)


@pytest.mark.parametrize("rho", [0.0, 0.6])
@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_what_columns_save_is_the_same_in_any_unit_of_theirs(scale: float, rho: float) -> None:
    rng = np.random.default_rng(SEED + 1)
    found = fitted(np.ones((N, 1)), rng.normal(size=N), rho)
    columns = rng.normal(size=(N, 6))
    blocks = [columns[:, :3], columns[:, 3:]]
    pairs = [BlockProducts(np.float32(k * columns), 2) for k in (1.0, scale)]
    gains = found.gains(columns)
    np.testing.assert_allclose(found.gains(scale * columns), gains, rtol=1e-9)
    np.testing.assert_allclose(
        found.block_gains(Blocks([scale * block for block in blocks])),
        found.block_gains(Blocks(blocks)),
        rtol=1e-9,
    )
    assert found.gain(scale * columns)[0] == pytest.approx(found.gain(columns)[0], rel=1e-9)
    one, other = (found.pair_gains(pair) for pair in pairs)
    assert (one > 0.0).all()
    np.testing.assert_allclose(other, one, rtol=1e-4)


@pytest.mark.parametrize(("share", "counts"), [(0.9e-4, False), (1.1e-4, True)])
def test_a_column_counts_from_a_ten_thousandth_of_its_power_on(share: float, counts: bool) -> None:
    q = basis()
    y = q @ np.array([3.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    found = fitted(q[:, :1], y)
    column = between(q[:, 0], q[:, 1], share)[:, None]
    # Of seven ones left it takes one, by a coefficient of 1 / sqrt(share).
    saved = N * np.log(7.0 / 6.0) if counts else 0.0
    assert found.gains(column)[0] == pytest.approx(saved, rel=1e-6)
    assert found.gain(column)[0] == pytest.approx(saved, rel=1e-6)
    assert found.block_gains(Blocks([column]))[0] == pytest.approx(saved, rel=1e-6)
    fixed = N * np.log(7.0 / (7.0 - 2.0 * np.sqrt(share) + share)) if counts else 0.0
    assert found.fixed_gains(column)[0] == pytest.approx(fixed, rel=1e-6)
    assert found.projected(column)[1].tolist() == [counts]
    # One of two in a block that does not count takes the block with it.
    both = np.column_stack([q[:, 2], column])
    two = N * np.log(7.0 / 5.0) if counts else 0.0
    assert found.block_gains(Blocks([both]))[0] == pytest.approx(two, rel=1e-6)


@pytest.mark.parametrize(("ratio", "counts"), [(0.9e-4, False), (1.1e-4, True)])
def test_columns_of_a_block_are_told_apart_by_the_ratio_of_what_is_left(
    ratio: float, counts: bool
) -> None:
    """Two of correlation r leave 1 - r of one combination for 1 + r of the other."""
    q = basis()
    found = fitted(q[:, :1], q.sum(axis=1))
    r = (1.0 - ratio) / (1.0 + ratio)
    block = np.column_stack([q[:, 1], between(q[:, 1], q[:, 2], 1.0 - r**2)])
    saved = N * np.log(7.0 / 5.0) if counts else 0.0
    assert found.block_gains(Blocks([block]))[0] == pytest.approx(saved, rel=1e-6)


@pytest.mark.parametrize(("determinant", "counts"), [(0.9e-3, False), (1.1e-3, True)])
@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_pairs_are_told_apart_by_their_determinant(
    scale: float, determinant: float, counts: bool
) -> None:
    """Of two unit columns sin^2 of their angle, in single precision; or what is left of one."""
    q = basis()
    found = fitted(q[:, :1], q.sum(axis=1))
    alike = np.column_stack([q[:, 1], between(q[:, 1], q[:, 2], determinant)])
    known = np.column_stack([q[:, 1], between(q[:, 0], q[:, 2], determinant)])
    gains = found.pair_gains(BlockProducts(np.float32(scale * np.hstack([alike, known])), 2))
    saved = N * np.log(7.0 / 5.0) if counts else 0.0
    np.testing.assert_allclose(gains, [saved, saved], rtol=2e-3)


def test_columns_fitted_too_cost_their_degrees_of_freedom() -> None:
    """Each that is told apart, to a share of 1e-8 of the power; another target forgets them."""
    q = basis()
    y = q.sum(axis=1)
    found = fitted(q[:, :1], y)
    for tilt, rank in ((1.2e-4, 3), (0.8e-4, 2)):
        # Singular values of two unit columns at an angle a are as tan(a/2) to 1.
        angle = 2.0 * np.arctan(tilt)
        columns = np.column_stack([q[:, 1], np.cos(angle) * q[:, 1] + np.sin(angle) * q[:, 2]])
        joint = found.jointly_with(columns)
        assert joint.rank == rank
        assert joint.rss == pytest.approx(8.0 - rank, rel=1e-3)
        assert joint.variance == pytest.approx(joint.rss / (N - rank))
        assert joint.q.shape == (N, rank)
        plain = joint.of_target(y)
        assert (plain.rank, plain.rss) == (1, pytest.approx(7.0))
        assert plain.further is None
        more = joint.jointly_with(q[:, 3:5])
        assert (more.rank, more.rss) == (rank + 2, pytest.approx(6.0 - rank, rel=1e-3))


def test_all_that_is_saved_is_finite_and_no_more_than_rounding() -> None:
    q = basis()
    found = fitted(q[:, :1], q.sum(axis=1))
    every = N * 15.0 * np.log(10.0)
    for saved in (found.rss, 2.0 * found.rss):
        assert found.as_deviances(np.array(saved)) == pytest.approx(every, rel=1e-2)
    assert found.as_deviances(-found.rss) == pytest.approx(-N * np.log(2.0))


@pytest.mark.parametrize(("std", "explained"), [(0.9e-6, True), (1.1e-6, False)])
def test_less_than_a_millionth_of_an_arcsec_is_rounding(std: float, explained: bool) -> None:
    q = basis()
    found = fitted(q[:, :1], 5.0 * q[:, 0] + std * np.sqrt(N - 1.0) * q[:, 1])
    assert found.variance == pytest.approx(std**2)
    assert found.is_explained == explained
