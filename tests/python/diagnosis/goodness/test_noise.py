"""The deviation of one reading and its correlation, beside a pattern nobody knows."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.diagnosis.goodness import estimate_noise, goodness_of_fit
from trueangle.diagnosis.goodness.leftover import Leftover
from trueangle.diagnosis.goodness.noise import _without_spikes
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


@pytest.mark.parametrize("rho", [0.6, 0.0, -0.2])
def test_the_noise_is_the_likeliest_beside_patterns_and_zeros(rho: float) -> None:
    """Slow: the restricted likelihood of the full covariance, of two runs of 150 and 250."""
    print("seed 3100")
    rng = np.random.default_rng(3100)
    run = np.repeat([0, 1], [150, 250])
    e = rng.uniform(-3.0, 3.0, run.size)
    for i in np.flatnonzero(np.diff(run, prepend=-1) == 0):
        e[i] += rho * e[i - 1]
    theta = np.concatenate([np.linspace(0.0, 4.0 * np.pi, 150), np.linspace(0.0, 9.0, 250)])
    angle = np.outer(theta, np.arange(1, 13))
    design = np.column_stack([run == 0, run == 1, np.cos(angle), np.sin(angle)]).astype(float)
    y = e + 40.0 * run + 25.0 * np.cos(3.0 * theta)
    found = estimate_noise(Leftover(y, theta, np.ones(run.size), run, np.arange(400.0)))
    freedom = run.size - design.shape[1]
    assert found.freedom == freedom
    lags = np.abs(np.subtract.outer(np.arange(400), np.arange(400)))
    together = np.equal.outer(run, run)

    def likelihood(trial: float) -> tuple[float, float]:
        """Twice its negative logarithm, and the variance of one reading."""
        inverse = np.linalg.inv(np.where(together, trial**lags, 0.0))
        normal = design.T @ inverse @ design
        rest = y - design @ np.linalg.solve(normal, design.T @ inverse @ y)
        squares = float(rest @ inverse @ rest)
        determinants = np.linalg.slogdet(normal)[1] - np.linalg.slogdet(inverse)[1]
        return float(freedom * np.log(squares) + determinants), squares / freedom

    trials = np.linspace(rho - 0.1, rho + 0.1, 7)
    curve = np.polynomial.Polynomial.fit(trials, [likelihood(t)[0] for t in trials], 4)
    (best,) = [r.real for r in curve.deriv().roots() if abs(r.real - rho) < 0.1 and not r.imag]
    saved = likelihood(0.0)[0] - curve(best)
    assert found.root == pytest.approx(np.copysign(np.sqrt(max(saved, 0.0)), best), abs=0.05)
    told = rho > 0.3
    assert found.correlation == pytest.approx(best if told else 0.0, abs=2e-3)
    assert found.deviance == pytest.approx(saved if best > 0.0 else 0.0, abs=0.02 * saved + 0.1)
    variance = likelihood(found.correlation)[1]
    assert found.sigma == pytest.approx(np.sqrt(variance), rel=2e-3)
    bend = float(curve.deriv(2)(max(best, 0.0)))
    assert found.std == pytest.approx(np.sqrt(2.0 / bend), rel=0.05)


@pytest.mark.parametrize("place", [0, 20, 39, 40, 70, 89])
def test_a_spike_is_put_back_beside_its_neighbours(place: int) -> None:
    """Of its own run, which has a zero of its own; at either end there is one."""
    bounds = [(0, 40), (40, 90)]
    calm = np.random.default_rng(31).uniform(-1.0, 1.0, 90) + 1000.0 * (np.arange(90) >= 40)
    assert (_without_spikes(calm, bounds) == calm).all()
    for size in (500.0, -500.0):
        spiked = calm.copy()
        spiked[place] += size
        kept = _without_spikes(spiked, bounds)
        # Neighbours' mean, and four deviations of what is usual beside it: about 3.
        assert abs(kept[place] - calm[place]) < 7.0
        away = np.abs(np.arange(90) - place) > 1
        assert (kept[away] == calm[away]).all()


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
