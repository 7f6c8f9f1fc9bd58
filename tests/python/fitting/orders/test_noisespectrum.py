"""The noise near an order: drawn from known spectra, by scipy's distributions and minimizer."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, optimize, stats

from trueangle.fitting.orders.noiseshapes import bend_of, fit_shapes
from trueangle.fitting.orders.noisespectrum import NoiseSpectrum, log_chance, noise_spectrum

Array = NDArray[np.float64]
SEED = 70_412


def remembering(orders: Array, memory: float) -> Array:
    """Spectrum of noise that remembers so much of the reading before; the highest is half."""
    w = np.pi * orders / orders.max()
    return np.asarray((1.0 - memory**2) / np.abs(1.0 - memory * np.exp(1j * w)) ** 2)


def told_by_orders(rng: np.random.Generator, spectrum: Array, freedom: int) -> Array:
    return np.asarray(spectrum * rng.chisquare(freedom, spectrum.size) / freedom)


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
@pytest.mark.parametrize(("count", "freedom"), [(17, 6), (100, 2), (100, 6)])
def test_noise_has_the_chance_that_it_is_told_to_have(
    count: int, freedom: int, memory: float
) -> None:
    """Each of 200 seeds tells the noise, and noise of its own is asked for its chance.

    Of 200 x count chances the share below p is known to a tenth of p at 0.05; between the seeds
    the told spectrum differs, which doubles that.
    """
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, count + 1.0)
    spectrum = remembering(orders, memory)
    chances, white = [], 0
    for _ in range(200):
        found = noise_spectrum(orders, told_by_orders(rng, spectrum, freedom), freedom)
        assert found is not None
        white += found.white > 0.5
        chances.append(np.exp(found.log_chance(spectrum * rng.chisquare(2, count))))
    share = np.mean(np.array(chances)[:, :, None] < np.array([0.3, 0.05, 0.002]), axis=(0, 1))
    away = np.abs(share - [0.3, 0.05, 0.002])
    assert (away < [0.03, 0.012, 0.0015]).all(), share
    assert white >= 185 if memory == 0.0 else white <= 6
    # At the lowest orders, which have neighbours on one side only.
    low = np.mean(np.array(chances)[:, :2] < 0.05)
    assert 0.015 < low < 0.095


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_variance_is_known_as_well_as_its_freedom_says(memory: float) -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, 61.0)
    spectrum = remembering(orders, memory)
    pulls = []
    for _ in range(150):
        found = noise_spectrum(orders, told_by_orders(rng, spectrum, 4), 4)
        assert found is not None
        freedom = 1.0 / (found.beliefs @ (1.0 / found.freedoms))
        pulls.append(np.log(found.variance / spectrum) / np.sqrt(2.0 / freedom))
    middle = np.array(pulls)[:, 5:50]
    assert abs(middle.mean()) < 0.35
    assert 0.7 < middle.std() < 1.35


def test_lines_move_the_noise_by_little() -> None:
    """Each of four lines in sixty counts as the upper 5 % of noise: 3 of 0.95, 13 % in all."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, 61.0)
    told = told_by_orders(rng, np.ones(60), 2)
    with_lines = told.copy()
    with_lines[[4, 20, 33, 50]] = 1e4
    before, after = (noise_spectrum(orders, t, 2) for t in (told, with_lines))
    assert before is not None
    assert after is not None
    ratio = after.variance / before.variance
    assert ratio.min() > 1.0
    assert ratio.max() < 1.35
    assert after.log_chance(2e4 * np.ones(60)).max() < np.log(1e-12)


def test_the_unit_scales_it_and_what_is_not_told_is_left_out() -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, 41.0)
    told = told_by_orders(rng, remembering(orders, 0.7), 6)
    one, other = (noise_spectrum(orders, scale * told, 6) for scale in (1.0, 3600.0**2))
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(other.variances, 3600.0**2 * one.variances, rtol=2e-3)
    np.testing.assert_allclose(other.beliefs, one.beliefs, atol=1e-3)
    np.testing.assert_allclose(other.freedoms, one.freedoms, rtol=1e-9)
    # An order that is not told has a variance all the same, by the others alone.
    told[10] = np.nan
    gap = noise_spectrum(orders, told, 6)
    assert gap is not None
    told[10] = np.inf
    infinite = noise_spectrum(orders, told, 6)
    assert infinite is not None
    np.testing.assert_array_equal(gap.variances, infinite.variances)
    assert 0.7 < gap.variance[10] / np.sqrt(gap.variance[9] * gap.variance[11]) < 1.4


def test_fewer_than_a_dozen_orders_and_copies_tell_nothing() -> None:
    orders = np.arange(1.0, 13.0)
    told = np.linspace(0.5, 2.0, 12)
    assert noise_spectrum(orders, told, 2) is not None
    assert noise_spectrum(orders[:11], told[:11], 2) is None
    assert noise_spectrum(orders, told, 2, independent=0.99) is None
    assert noise_spectrum(orders, np.zeros(12), 2) is None


@pytest.mark.parametrize("independent", [1.0, 0.5])
def test_white_noise_is_told_by_all_orders(independent: float) -> None:
    """One coefficient: a variance of as many degrees of freedom as the orders have together."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    told = told_by_orders(rng, np.full(50, 0.3), 8)
    found = noise_spectrum(np.arange(1.0, 51.0), told, 8, independent)
    assert found is not None
    white = int(np.argmax(found.beliefs))
    assert found.white > 0.8
    assert np.ptp(found.variances[white]) < 1e-12
    assert found.variances[white, 0] == pytest.approx(told.mean(), rel=0.02)
    expected = independent * 50 * 8 / bend_of(8).widening
    np.testing.assert_allclose(found.freedoms[white], expected, rtol=1e-9)


def test_a_shape_takes_its_coefficients_from_the_orders() -> None:
    """Leverages of the orders that tell it have the sum of its coefficients."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, 81.0)
    told = told_by_orders(rng, np.exp(2.0 * np.cos(np.pi * orders / 80.0)) / orders, 6)
    found = noise_spectrum(orders, told, 6)
    assert found is not None
    taken = (6.0 / bend_of(6).widening / found.freedoms).sum(axis=1)
    np.testing.assert_allclose(taken, np.rint(taken), atol=1e-9)
    assert taken.min() >= 2.0
    assert taken.max() <= 6.0 + 1e-9


def test_below_an_order_no_more_noise_is_believed() -> None:
    """Noise that forgets has half of its spectrum at the corner: no more than twice that below."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = np.arange(1.0, 101.0)
    told = told_by_orders(rng, orders**-2.0, 2)
    told[:5] = np.nan
    free, bound = (noise_spectrum(orders, told, 2, flat_below=at) for at in (0.0, 5.0))
    assert free is not None
    assert bound is not None
    assert (bound.variances[:, 0] <= 2.0 * bound.variances[:, 4]).all()
    assert free.variance[0] > 3.0 * free.variance[4]


@pytest.mark.parametrize("freedom", [2, 4, 14])
def test_moments_of_what_is_bent(freedom: int) -> None:
    bend = bend_of(freedom)
    law = stats.chi2(freedom, scale=1.0 / freedom)
    assert law.sf(bend.at) == pytest.approx(0.05)
    mean, square = (
        integrate.quad(lambda v, p=power: min(v, bend.at) ** p * law.pdf(v), 0.0, 30.0, limit=200)[
            0
        ]
        for power in (1, 2)
    )
    slope = integrate.quad(lambda v: v * law.pdf(v), 0.0, bend.at)[0]
    assert bend.mean == pytest.approx(mean, rel=1e-7)
    variance = (square - mean**2) / slope**2
    assert bend.widening == pytest.approx(variance / (2.0 / freedom), rel=1e-6)


def test_coefficients_have_the_least_loss() -> None:
    """Against scipy's minimizer of the loss whose slope is the bent ratio less its mean."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    basis = np.column_stack([np.ones(40), np.linspace(-1.0, 1.0, 40)])
    values = told_by_orders(rng, np.exp(basis @ [0.4, -1.5]), 4)
    values[3] = 500.0
    bend = bend_of(4)

    def loss(c: Array) -> float:
        log = basis @ c
        ratio = values * np.exp(-log)
        bent = np.where(
            ratio < bend.at,
            ratio / bend.mean,
            bend.at / bend.mean * (1.0 + np.log(np.maximum(ratio, 1e-300) / bend.at)),
        )
        return float((log + bent).sum())

    least = optimize.minimize(loss, np.zeros(2), method="Nelder-Mead", tol=1e-10)
    found, told = fit_shapes(basis[None], np.linalg.pinv(basis)[None], values[None], bend)
    np.testing.assert_allclose(found[0], least.x, atol=1e-3)
    assert told == pytest.approx([least.fun], abs=1e-5)


@pytest.mark.parametrize("freedom", [2, 22])
def test_a_level_is_found_exactly_whatever_lines_are_among_the_orders(freedom: int) -> None:
    rng = np.random.default_rng(SEED)
    values = rng.chisquare(freedom, (5, 60)) / freedom * np.geomspace(1e-3, 1e4, 5)[:, None]
    values[1, 20:] *= np.geomspace(1.0, 1e9, 40)
    values[2, :20] = 0.0
    basis, bend = np.ones((5, 60, 1)), bend_of(freedom)
    found, _ = fit_shapes(basis, np.linalg.pinv(basis), values, bend)
    bent = np.minimum(values * np.exp(-found), bend.at)
    np.testing.assert_allclose(bent.mean(axis=1), bend.mean, rtol=1e-12)


def test_the_chance_is_that_of_every_shape_by_its_belief() -> None:
    variances, freedoms = np.array([[1.0, 2.0], [4.0, 9.0]]), np.array([[30.0, 9.0], [12.0, 1e15]])
    noise = NoiseSpectrum(variances, freedoms, np.array([0.8, 0.2]))
    gain = np.array([11.0, 70.0])
    tails = stats.f.sf(0.5 * gain / variances, 2, np.minimum(freedoms, 1e9))
    np.testing.assert_allclose(np.exp(noise.log_chance(gain)), [0.8, 0.2] @ tails, rtol=1e-5)
    np.testing.assert_allclose(noise.variance, variances[0] ** 0.8 * variances[1] ** 0.2)
    swapped = noise.among([1, 0])
    np.testing.assert_array_equal(swapped.log_chance(gain[::-1]), noise.log_chance(gain)[::-1])
    flat = NoiseSpectrum.flat(2.0, 9.0, 2)
    np.testing.assert_allclose(flat.log_chance(gain), log_chance(gain / 2.0, 9.0))
