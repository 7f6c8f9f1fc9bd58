"""The deviation of one reading and its correlation, beside a pattern nobody knows."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.diagnosis.goodness import estimate_noise, goodness_of_fit
from trueangle.diagnosis.goodness.leftover import Leftover
from trueangle.diagnosis.goodness.scatter import scatter_of_repeats
from trueangle.diagnosis.goodness.zeros import variance_of_mean

from .readings import Motion, leftover

#: Standard errors that the mean of eight estimates may be off: ten designs and kinds, 5e-5 each.
OFF = 4.0


def pattern(m: Motion, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(np.sin(5.0 * m.theta) + 0.5 * m.direction * np.cos(3.0 * m.theta + 1.0))


@pytest.mark.parametrize("hidden", [0.0, 3.0])
@pytest.mark.parametrize(("kind", "rho"), [("gauss", 0.0), ("ar 0.5", 0.5), ("ar 0.9", 0.9)])
@pytest.mark.parametrize("design", ["rich", "few", "part"])
def test_correlation_and_deviation(design: str, kind: str, rho: float, hidden: float) -> None:
    found = [
        estimate_noise(leftover(design, kind, 40 + s, pattern if hidden else None, hidden))
        for s in range(8)
    ]
    correlation = np.array([noise.correlation for noise in found])
    if rho == 0.0:
        assert (correlation == 0.0).all()
    else:
        said = np.mean([noise.std for noise in found])
        assert abs(correlation.mean() - rho) < OFF * said / np.sqrt(8.0) + 0.01
        # What is said of the uncertainty is right to a factor of two, either way.
        assert 0.5 * said < correlation.std(ddof=1) < 2.0 * said
    assert abs(np.mean([noise.sigma for noise in found]) - 1.0) < 0.05


def test_variance_of_a_mean_is_that_of_the_full_covariance() -> None:
    noise = estimate_noise(leftover("rich", "ar 0.9", 3))
    lags = np.abs(np.subtract.outer(np.arange(50), np.arange(50)))
    full = noise.sigma**2 * np.mean(noise.correlation**lags)
    assert variance_of_mean(50, noise) == pytest.approx(full, rel=1e-12)


def test_repeats_spend_a_mean_of_each_place_and_direction_and_of_each_run() -> None:
    """Of 142 readings 71 means and one zero between two runs: 300 draws of few repeats."""
    places = np.radians(
        np.concatenate([np.arange(0.0, 350.0, 10.0), np.arange(350.0, -1.0, -10.0)])
    )
    theta, run = np.tile(places, 2), np.repeat([0, 1], 71)
    direction = np.tile(np.repeat([1.0, -1.0], [35, 36]), 2)
    unlike = 50.0 * direction + 9.0 * np.cos(3.0 * theta) + 5.0 * run
    rng = np.random.default_rng(2)
    found = [
        scatter_of_repeats(
            Leftover(unlike + rng.normal(0.0, 2.0, 142), theta, direction, run, np.arange(142.0))
        )
        for _ in range(300)
    ]
    assert {freedom for _, freedom in found} == {70.0}
    # Five standard errors of the mean variance.
    squares = np.square([scatter for scatter, _ in found])
    assert squares.mean() == pytest.approx(4.0, abs=5.0 * 4.0 * np.sqrt(2.0 / 70 / 300))


def test_rounded_angles_are_no_repeats() -> None:
    left = leftover("grid", "gauss", 5)
    again = scatter_of_repeats(left)
    assert again is not None
    assert again[0] == pytest.approx(1.0, abs=0.1)
    rounded = leftover("rich", "gauss", 5)
    step = np.radians(0.5)
    object.__setattr__(rounded, "theta", np.round(rounded.theta / step) * step)
    assert scatter_of_repeats(rounded) is None


@pytest.mark.parametrize(("kind", "test"), [("t5", "tails"), ("ar 0.5", "correlation")])
def test_the_noise_is_described(kind: str, test: str) -> None:
    for noise, fires in ((kind, True), ("gauss", False)):
        fit = goodness_of_fit(leftover("rich", noise, 12), 40)
        item = next(e for e in fit.evidence if e.test == test)
        assert (item.p < 1e-4) == fires
        assert not item.decides


def test_noise_is_held_against_the_simulation() -> None:
    left = leftover("rich", "gauss", 8)
    for sigma, fires in ((1.0, False), (0.8, True)):
        fit = goodness_of_fit(left, 40, sigma)
        item = next(e for e in fit.evidence if e.test == "noise against the simulation's")
        assert (item.p < 0.001) == fires
        assert item.statistic == pytest.approx(1.0 / sigma, rel=0.03)
