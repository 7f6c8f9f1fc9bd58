"""The map that makes noise white, against the noise's covariance as one dense matrix."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle.estimation.blocks import BlockProducts, Blocks
from trueangle.estimation.whitening import LagCorrelation, RunEffect, Whitener, drift_basis

from .dense import BOUNDS, CASES, N, case, covariance


@pytest.mark.parametrize("kind", CASES)
def test_the_map_makes_the_covariance_the_unit_matrix(kind: tuple) -> None:
    whiten = case(*kind)
    v = covariance(whiten)
    m = whiten(np.eye(N))
    np.testing.assert_allclose(m @ v @ m.T, np.eye(N), atol=1e-10)
    assert whiten.log_determinant == pytest.approx(np.linalg.slogdet(v)[1], abs=1e-9)
    x = np.random.default_rng(3).normal(size=(N, 3))
    column, keep = np.ascontiguousarray(x[:, 1]), x.copy()
    np.testing.assert_allclose(whiten(column), m @ column, atol=1e-12)
    # As columns see it that are not mapped: the transpose of the map, applied.
    seen = whiten.beside(np.eye(N), column, 1.0, 0.0).seen
    np.testing.assert_allclose(seen, np.vstack([m, m.T @ column]), atol=1e-12)
    for order in (x, np.asfortranarray(x), x[:, :0]):
        np.testing.assert_allclose(whiten(order), m @ order, atol=1e-12)
    whiten.beside(x, column, 1.0, 0.0)
    np.testing.assert_array_equal(np.column_stack([x, column]), keep[:, [0, 1, 2, 1]])
    assert whiten.is_identity == (kind == (0.0, (), False))


@pytest.mark.parametrize("kind", [kind for kind in CASES if kind[1]])
def test_what_run_effects_take_of_products(kind: tuple) -> None:
    whiten = case(*kind)
    without = Whitener(BOUNDS, whiten.rho, [], whiten.weights)(np.eye(N))
    w, c = whiten.taken()
    x, y = np.random.default_rng(4).normal(size=(2, N))
    whole = (without @ x) @ (without @ y) - sum(
        ((w[a:b].T @ x[a:b]) * c[j]) @ (w[a:b].T @ y[a:b]) for j, (a, b) in enumerate(BOUNDS)
    )
    assert whole == pytest.approx(whiten(x) @ whiten(y), abs=1e-10)


@pytest.mark.parametrize("kind", CASES)
def test_products_within_blocks_are_those_of_the_inverse_covariance(kind: tuple) -> None:
    whiten = case(*kind)
    inverse = np.linalg.inv(covariance(whiten))
    rng = np.random.default_rng(5)
    blocks = [rng.normal(size=(N, width)) for width in (2, 1, 2, 3, 1)]
    grouped = Blocks(blocks)
    assert grouped.count == 5
    seen = 0
    for places, products in grouped.groups:
        # Kept from noise to noise: after another one it is the same again.
        for noise in (whiten, case(0.3, (), True, 9), whiten, case(*kind, seed=2)):
            own = inverse if noise is whiten else np.linalg.inv(covariance(noise))
            for place, gram in zip(places, products.under(noise), strict=True):
                np.testing.assert_allclose(
                    gram, blocks[place].T @ own @ blocks[place], atol=1e-9, rtol=1e-9
                )
        seen += places.size
    assert seen == 5
    single = BlockProducts(np.hstack(blocks[:1]).astype(np.float32), 2).under(whiten)
    np.testing.assert_allclose(single[0], blocks[0].T @ inverse @ blocks[0], rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("chosen", [None, (True, False), (False, True), (True, True)])
def test_the_part_of_run_effects_is_their_best_guess(chosen: tuple | None) -> None:
    """Of white noise beside: Z S Z' (I + Z S Z')^-1 y, of the chosen columns alone."""
    whiten = case(0.0, (0.3, 4.0), False)
    y = np.random.default_rng(8).normal(size=N)
    weighed = np.linalg.solve(covariance(whiten), y)
    expected = np.zeros(N)
    for a, b in BOUNDS:
        for k, effect in enumerate(whiten.effects):
            if chosen is None or chosen[k]:
                z = effect.columns[a:b]
                expected[a:b] += effect.ratio * z @ (z.T @ weighed[a:b])
    np.testing.assert_allclose(whiten.run_part(y, chosen), expected, atol=1e-10)
    assert not case(0.4, (), True).run_part(y).any()


def test_a_noise_is_told_by_its_correlation_effects_and_weights() -> None:
    whiten = case(0.4, (0.3, 4.0), True)
    assert whiten.has(0.4, list(whiten.effects), whiten.weights)
    assert not whiten.has(0.41, whiten.effects, whiten.weights)
    assert not whiten.has(0.4, whiten.effects[:1], whiten.weights)
    assert not whiten.has(0.4, whiten.effects[::-1], whiten.weights)
    assert not whiten.has(0.4, whiten.effects, whiten.weights.copy())


def test_effects_far_larger_than_the_noise_and_far_larger_than_each_other() -> None:
    z = np.column_stack([np.ones(N), 1e8 * np.linspace(-1.0, 1.0, N)])
    whiten = Whitener(BOUNDS, 0.0, [RunEffect(z, 1e4)])
    y = 3.0 + 2.0 * np.linspace(-1.0, 1.0, N)
    np.testing.assert_allclose(whiten.run_part(y), y, atol=1e-3)


@pytest.mark.parametrize("kind", CASES)
def test_the_determinant_run_by_run(kind: tuple) -> None:
    whiten = case(*kind)
    v = covariance(whiten)
    for run, (a, b) in enumerate(BOUNDS):
        expected = np.linalg.slogdet(v[a:b, a:b])[1]
        if whiten.weights is not None:
            expected += np.log(whiten.weights[a:b]).sum()
        assert whiten.log_determinant_of(run) == pytest.approx(expected, abs=1e-9)


def test_wander_is_half_periods_over_the_record() -> None:
    clock = np.array([3.0, 4.0, 7.0])
    found = drift_basis(clock, 3)
    for k in (1, 2, 3):
        np.testing.assert_allclose(found[:, k - 1], np.cos(np.pi * k * np.array([0.0, 0.25, 1.0])))
    assert drift_basis(clock).shape == (3, 8)
    np.testing.assert_allclose(drift_basis(clock / 9.0, 3), found, atol=1e-12)
    np.testing.assert_array_equal(drift_basis(np.full(2, 5.0), 2), np.ones((2, 2)))


def slow_correlation(clock: np.ndarray, bounds: list, residual: np.ndarray) -> float:
    product = power = pairs = 0.0
    for a, b in bounds:
        if b - a < 17:
            continue
        u = (clock[a:b] - clock[a]) / (clock[b - 1] - clock[a])
        x = np.stack([np.cos(np.pi * k * u) for k in range(9)], axis=1)
        e = residual[a:b] - x @ np.linalg.lstsq(x, residual[a:b], rcond=None)[0]
        product += sum(e[i] * e[i + 1] for i in range(len(e) - 1))
        power += e @ e
        pairs += len(e) - 1
    return product / power if pairs and product / power > max(0.05, 4.0 / pairs**0.5) else 0.0


@pytest.mark.parametrize("rho", [0.0, 0.12, 0.2, 0.5, -0.5])
@pytest.mark.parametrize("lengths", [(300, 17, 200), (16, 300), (6000,)])
def test_correlation_of_neighbours_after_wander(rho: float, lengths: tuple) -> None:
    rng = np.random.default_rng(10)
    edges = np.cumsum((0, *lengths))
    bounds = [(int(a), int(b)) for a, b in itertools.pairwise(edges)]
    e = rng.normal(size=edges[-1])
    for i in range(1, e.size):
        e[i] += rho * e[i - 1]
    clock = np.cumsum(rng.uniform(0.5, 1.5, e.size))
    e += 30.0 * np.cos(np.pi * np.linspace(0.0, 1.0, e.size)) * (len(lengths) == 1)
    found = LagCorrelation(clock, bounds)(e)
    assert found == pytest.approx(slow_correlation(clock, bounds, e), abs=1e-3)


def test_correlation_at_its_bounds() -> None:
    clock = np.arange(16.0)
    assert LagCorrelation(clock, [(0, 16)])(np.random.default_rng(0).normal(size=16)) == 0.0
    assert LagCorrelation(np.arange(60.0), [(0, 60)])(np.zeros(60)) == 0.0
    # Half a period in forty readings, far from its cosines: all but one.
    slow = np.repeat(np.random.default_rng(1).normal(size=50), 200)
    assert LagCorrelation(np.arange(10_000.0), [(0, 10_000)])(slow) == 0.98


@pytest.mark.parametrize(("share", "counts"), [(0.995, False), (1.005, True)])
def test_a_correlation_counts_from_four_of_its_standard_errors(share: float, counts: bool) -> None:
    """Of many short runs, whose ends are no pairs: 4 / sqrt(pairs) is beyond what is white."""
    runs, n = 150, 40
    noise = np.random.default_rng(12).normal(size=(runs, n + 1))
    u = np.arange(n) / (n - 1)
    x = np.stack([np.cos(np.pi * k * u) for k in range(9)], axis=1)
    kept = np.eye(n) - x @ np.linalg.pinv(x)
    threshold = 4.0 / math.sqrt(runs * (n - 1))

    def made(mixed: float) -> np.ndarray:
        return noise[:, 1:] + mixed * noise[:, :-1]

    def correlation(mixed: float) -> float:
        e = made(mixed) @ kept
        return float((e[:, 1:] * e[:, :-1]).sum() / (e**2).sum())

    low, high = 0.0, 1.0
    assert correlation(low) < share * threshold < correlation(high)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if correlation(middle) < share * threshold else (low, middle)
    bounds = [(k * n, (k + 1) * n) for k in range(runs)]
    found = LagCorrelation(np.tile(np.arange(float(n)), runs), bounds)(made(high).ravel())
    assert found == (pytest.approx(share * threshold, rel=1e-6) if counts else 0.0)
