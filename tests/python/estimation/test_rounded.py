"""Fits of rounded readings: likelihood, estimates, and errors drawn within the steps."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle._core as _core
from trueangle.estimation.readings import Readings
from trueangle.estimation.rounded import LEAST_NOISE, fit_rounded

N = 240
PLACES = np.arange(N) / N


def columns() -> np.ndarray:
    """A constant and a line of order 2, orthonormal over the places of a turn."""
    x = 4.0 * np.pi * PLACES
    return np.column_stack([np.ones(N), np.cos(x) * math.sqrt(2), np.sin(x) * math.sqrt(2)]) / (
        math.sqrt(N)
    )


def test_errors_and_likelihood_are_those_of_the_normal_density_between_two_limits():
    left, step, sigma = np.linspace(-3.0, 3.0, 25), 1.0, 0.4
    error, squares, log_likelihood = _core.rounded(left, step, sigma)
    inside = left[:, None] + step * ((np.arange(20_000) + 0.5) / 20_000 - 0.5)
    density = np.exp(-0.5 * (inside / sigma) ** 2)
    chance = density.mean(axis=1) * step / sigma / math.sqrt(2.0 * math.pi)
    weights = density / density.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(error, (weights * inside).sum(axis=1), atol=1e-7)
    assert squares == pytest.approx((weights * inside**2).sum(), rel=1e-7)
    assert log_likelihood == pytest.approx(np.log(chance).sum(), rel=1e-7)


@pytest.mark.parametrize("arguments", [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (1.0, math.nan)])
def test_steps_and_noise_are_above_zero(arguments):
    with pytest.raises(ValueError, match="above zero"):
        _core.rounded(PLACES, *arguments)
    with pytest.raises(ValueError, match="above zero"):
        _core.rounded_drawn(PLACES, *arguments, PLACES)


def test_one_share_for_each_reading():
    with pytest.raises(ValueError, match="shares"):
        _core.rounded_drawn(PLACES, 1.0, 1.0, PLACES[1:])


@pytest.mark.parametrize("noise", [0.1, 0.25, 0.5])
def test_the_fit_has_no_bias_though_every_run_rounds_alike(noise):
    """What is left of the truth in 200 repetitions, by their own scatter: mean and noise."""
    rng = np.random.default_rng([17, round(100 * noise)])
    basis, found, sigmas, plain = columns(), [], [], []
    truth = 0.13 + 0.31 * np.cos(4.0 * np.pi * PLACES + 1.0)
    for _ in range(200):
        y = np.round(13.0 * PLACES + truth + rng.normal(0.0, noise, N)) - 13.0 * PLACES
        fit = fit_rounded(basis, y, 1.0)
        found.append(basis.T @ (fit.fitted - truth))
        plain.append(basis.T @ (y - truth))
        sigmas.append(fit.sigma)
    scatter = np.std(found, axis=0)
    assert (np.abs(np.mean(found, axis=0)) < 4.0 * scatter / math.sqrt(200)).all()
    # Three of 240 degrees of freedom are taken up; the likelihood counts them.
    assert np.mean(sigmas) == pytest.approx(noise, rel=0.03)
    # It is worth no less than least squares, of which the rounding is a part of the noise.
    room = 1.0 + 4.0 / math.sqrt(2.0 * 200)
    assert (scatter < room * np.hypot(noise, 1.0 / math.sqrt(12.0))).all()
    assert (scatter > noise / room).all()


def test_errors_drawn_within_the_steps_are_the_noise_before_the_rounding():
    """Kolmogorov and Smirnov's distance of 40 fits at 240 places, and no place of its own."""
    rng = np.random.default_rng(5)
    basis, drawn = columns(), []
    for _ in range(40):
        y = np.round(13.0 * PLACES + rng.normal(0.0, 0.15, N)) - 13.0 * PLACES
        fit = fit_rounded(basis, y, 1.0)
        error = fit.drawn(rng)
        assert (np.abs(fit.left - error) <= 0.5 + 1e-9).all()  # it rounds to the reading
        drawn.append(error / fit.sigma)
    every = np.sort(np.concatenate(drawn))
    below = np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in every])
    distance = np.abs(below - (np.arange(every.size) + 0.5) / every.size).max()
    assert distance * math.sqrt(every.size) < 1.95  # one in a thousand
    at_places = np.mean(drawn, axis=0) * math.sqrt(40)
    assert float(at_places @ at_places) / N == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / N))
    # The rounding itself is a property of the place.
    plain = np.round(13.0 * PLACES) - 13.0 * PLACES
    assert 40.0 * float(np.var(plain)) > 3.0


def test_readings_that_the_rounding_explains_tell_no_more():
    basis = columns()
    y = np.round(13.0 * PLACES + 0.2) - 13.0 * PLACES
    fit = fit_rounded(basis, y, 1.0)
    assert fit.within
    assert LEAST_NOISE <= fit.sigma < 2.0 * LEAST_NOISE
    y[17] += 1.0  # a step farther than any fit
    assert not fit_rounded(basis, y, 1.0).within
    aside = np.arange(N) == 17
    without = fit_rounded(basis, y, 1.0, aside)
    assert without.within
    np.testing.assert_allclose(without.fitted, fit.fitted, atol=0.1)


def test_the_unit_of_the_readings_does_not_matter():
    rng = np.random.default_rng(8)
    y = np.round(13.0 * PLACES + rng.normal(0.0, 0.2, N)) - 13.0 * PLACES
    one, other = fit_rounded(columns(), y, 1.0), fit_rounded(columns(), 316.4 * y, 316.4)
    assert other.sigma == pytest.approx(316.4 * one.sigma, rel=1e-9)
    assert other.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-9)
    np.testing.assert_allclose(other.fitted, 316.4 * one.fitted, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("scatter", [0.02, 3.0, 400.0])
def test_steps_wider_than_all_residuals_are_none_of_the_sensor(scatter):
    """Two variances at most, whatever the unit; of even steps the variance is a twelfth."""
    for share, told in ((1.98, True), (2.02, False), (0.1, True)):
        step = scatter * np.sqrt(12.0 * share)
        readings = SimpleNamespace(signals=SimpleNamespace(count=step), scatter=scatter)
        found = Readings.rounding.func(readings)
        assert found == (pytest.approx(scatter * np.sqrt(share)) if told else 0.0)
