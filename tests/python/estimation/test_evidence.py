"""Orders and noise by their evidence: dense covariances, other people's code, and known truth."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import cho_factor, cho_solve, toeplitz
from statsmodels.regression.mixed_linear_model import MixedLM

from trueangle._core import Evidence, Groups
from trueangle.errors import ArgumentError
from trueangle.estimation.evidence import (
    CORRELATION_TIMES,
    CorrelatedNoise,
    RunReadings,
    estimate_by_evidence,
    noise_information,
)

#: The zero of a run, integrated over a flat prior.
LOG_TURN = math.log(2.0 * math.pi)


def harmonics(theta: np.ndarray, orders: list[int] | range) -> np.ndarray:
    waves = [f(k * theta) for k in orders for f in (np.cos, np.sin)]
    return np.stack(waves, axis=1)


def scattered(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A run at irregular times, with a pause."""
    time = np.cumsum(rng.gamma(2.0, 0.05, n)) + np.where(np.arange(n) > n // 3, 4.0, 0.0)
    return rng.uniform(-4.0, 9.0, n), rng.normal(3.0, 2.0, n), time


def covariance(noise: list[float], time: np.ndarray) -> np.ndarray:
    steps = time / np.median(np.diff(time))
    apart = np.abs(np.subtract.outer(steps, steps))
    terms = zip(noise[1:], CORRELATION_TIMES, strict=True)
    return noise[0] * np.eye(time.size) + sum(a * np.exp(-apart / length) for a, length in terms)


def test_information_is_that_of_the_dense_covariance() -> None:
    rng = np.random.default_rng(60)
    columns, left = rng.normal(size=(150, 3)), rng.normal(size=150).cumsum() / 5.0
    bounds, scale = [(0, 90), (90, 150)], float(np.var(left))
    parts = [(columns[a:b], left[a:b], None) for a, b in bounds]
    noise = Groups(parts, [3]).noise([1e6 * scale * 150], scale)
    dense = np.zeros((150, 150))
    for a, b in bounds:
        dense[a:b, a:b] = covariance(noise.tolist(), np.arange(float(b - a)))
        dense[a:b, a:b] -= dense[a, b - 1]
    expected = columns.T @ np.linalg.solve(dense, columns)
    np.testing.assert_allclose(noise_information(columns, left, bounds, scale), expected, rtol=1e-9)


def test_what_all_readings_of_a_run_share_is_its_zero() -> None:
    """The zero varies as under the dense covariance less the least covariance of two readings."""
    rng, runs = np.random.default_rng(61), []
    for theta, _, time in (scattered(rng, 70), scattered(rng, 130)):
        error = np.cos(theta) + np.cumsum(rng.normal(size=time.size)) / 5.0
        runs.append(RunReadings(theta, error + rng.normal(size=time.size), time))
    found = estimate_by_evidence(runs, [1, 2, 3])
    for (_, _, time, _), variance in zip(runs, found.zeros, strict=True):
        dense = covariance(found.noise.tolist(), time)
        assert variance == pytest.approx(1.0 / np.linalg.inv(dense - dense.min()).sum(), rel=1e-9)


NOISES = [[0.8, 0.3, 0.0, 0.9, 0.2, 3.0], [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]]


@pytest.mark.parametrize("noise", NOISES)
def test_posterior_is_that_of_the_dense_covariance(noise: list[float]) -> None:
    rng = np.random.default_rng(61)
    runs, orders = [scattered(rng, n) for n in (70, 40, 55)], [1, 3, 8]
    tau, omega = [5.0, 0.0, 0.7], [0.4, 0.0, 0.0]
    x = np.concatenate([harmonics(run[0], orders) for run in runs])
    prior, differs = np.diag(np.repeat(tau, 2)), np.diag(np.repeat(omega, 2))
    whole, zeros, y = np.zeros((165, 165)), np.zeros((165, 3)), np.zeros(165)
    start = 0
    for r, (theta, error, time) in enumerate(runs):
        part, own = slice(start, start + theta.size), harmonics(theta, orders)
        whole[part, part] = covariance(noise, time) + own @ differs @ own.T
        zeros[part, r], y[part] = 1.0, error
        start += theta.size
    whole += x @ prior @ x.T
    inverse = np.linalg.inv(whole)
    inner = zeros.T @ inverse @ zeros
    left = inverse - inverse @ zeros @ np.linalg.solve(inner, zeros.T @ inverse)
    expected = -0.5 * (np.linalg.slogdet(whole)[1] + np.linalg.slogdet(inner)[1] + y @ left @ y)
    log_evidence, mean, spread = Evidence([RunReadings(*run) for run in runs], orders).posterior(
        noise, tau, omega
    )
    assert log_evidence == pytest.approx(expected - 0.5 * 162 * LOG_TURN, abs=1e-9)
    np.testing.assert_allclose(mean, prior @ x.T @ left @ y, atol=1e-10)
    np.testing.assert_allclose(spread, prior - prior @ x.T @ left @ x @ prior, atol=1e-10)


@pytest.mark.parametrize("noise", NOISES)
def test_likelihood_of_the_noise_is_that_of_celerite2(noise: list[float]) -> None:
    celerite2 = pytest.importorskip("celerite2")
    theta, error, time = scattered(np.random.default_rng(62), 240)
    steps = time / np.median(np.diff(time))
    pairs = list(zip(noise[1:], CORRELATION_TIMES, strict=True))
    terms = [celerite2.terms.RealTerm(a=a, c=1.0 / length) for a, length in pairs]
    process = celerite2.GaussianProcess(celerite2.terms.TermSum(*terms))
    process.compute(steps, diag=np.full(240, noise[0]))
    information = process.apply_inverse(np.ones(240)).sum()
    zero = process.apply_inverse(error).sum() / information
    expected = process.log_likelihood(error - zero) + 0.5 * (LOG_TURN - math.log(information))
    found = Evidence([RunReadings(theta, error, time)], [1]).posterior(noise, [0.0], [0.0])
    assert found[0] == pytest.approx(expected, abs=1e-8)


def test_effects_of_runs_are_those_of_statsmodels() -> None:
    """REML of a component that both columns of an order share; zeros of runs are fixed."""
    rng = np.random.default_rng(63)
    runs, n = [], 30
    for _ in range(12):
        theta = rng.uniform(0.0, 6.0, n)
        own = np.array([4.0, -2.0]) + 1.5 * rng.normal(size=2)
        runs.append((theta, harmonics(theta, [2]) @ own + rng.normal(size=n), None))
    x = np.concatenate([harmonics(theta, [2]) for theta, _, _ in runs])
    error = np.concatenate([run[1] for run in runs])
    unit = np.repeat(np.arange(12), n)
    table = pd.DataFrame({"error": error, "cosine": x[:, 0], "sine": x[:, 1], "unit": unit})
    fitted = MixedLM.from_formula(
        "error ~ 0 + cosine + sine + C(unit)",
        groups="unit",
        re_formula="0",
        vc_formula={"order": "0 + cosine + sine"},
        data=table,
    ).fit(reml=True)
    white, omega = float(fitted.scale), float(fitted.vcomp[0])
    evidence = Evidence([RunReadings(*run) for run in runs], [2])

    def at(white: float, omega: float) -> tuple[float, np.ndarray, np.ndarray]:
        return evidence.posterior([white, 0.0, 0.0, 0.0, 0.0, 0.0], [1e7], [omega])

    best, mean, spread = at(white, omega)
    names = ["cosine", "sine"]
    np.testing.assert_allclose(mean, fitted.fe_params[names], rtol=1e-5)
    np.testing.assert_allclose(np.sqrt(np.diag(spread)), fitted.bse_fe[names], rtol=1e-4)
    for w, o in ((1.05, 1.0), (0.95, 1.0), (1.0, 1.1), (1.0, 0.9)):
        assert at(w * white, o * omega)[0] < best


def test_without_a_run_the_mixture_is_that_of_the_others_under_the_same_noise() -> None:
    rng, runs = np.random.default_rng(66), []
    for size in (3.0, 3.5, 2.0, 4.0):
        theta, noise, time = scattered(rng, 60)
        runs.append(RunReadings(theta, size * np.cos(2.0 * theta) + noise, time))
    whole = estimate_by_evidence(runs, range(1, 9))
    found = whole.without([2])
    kept = [run for r, run in enumerate(runs) if r != 2]
    evidence = Evidence([tuple(run) for run in kept], whole.told)
    assert found.runs == tuple(kept)
    assert found.readings == 180
    assert sum(model.weight for model in found.models) == pytest.approx(1.0)
    means, scores = [], []
    for model in found.models:
        score, mean, _ = evidence.posterior(whole.noise, model.tau, model.omega)
        means.append(mean)
        scores.append(score)
    np.testing.assert_allclose(
        found.mean, [m.weight for m in found.models] @ np.array(means), atol=1e-12
    )
    # Nothing of the run left out is in it: another one there changes no bit.
    moved = replace(whole, runs=(*runs[:2], runs[0], runs[3])).without([2])
    np.testing.assert_array_equal(moved.mean, found.mean)
    alone = estimate_by_evidence(kept, range(1, 9))
    angles = np.linspace(0.0, 2.0 * np.pi, 50)
    (mean, _), (other, std) = found.curve(angles), alone.curve(angles)
    assert np.abs(mean - other).max() < 0.3 * std.max()


def test_few_runs_tell_by_two_coefficients_each_what_they_differ_by() -> None:
    rng, runs = np.random.default_rng(67), []
    for _ in range(4):
        theta, noise, time = scattered(rng, 60)
        own = 40.0 + 20.0 * rng.normal(size=2)
        error = harmonics(theta, [2]) @ own + 5.0 * np.cos(theta) + noise
        runs.append(RunReadings(theta, error, time))
    found = estimate_by_evidence(runs, range(1, 5))
    variance = np.diag(found.among([1, 2], np.linspace(0.0, 6.28, 90))[1])
    shared, differing = np.split(found.freedom_of_runs([1, 2], variance, 230.0), 2)
    np.testing.assert_allclose(differing, 6.0, rtol=0.15)
    assert (shared > 100.0).all()
    one = estimate_by_evidence(runs[:1], range(1, 5))
    assert (one.freedom_of_runs([1, 2], variance, 55.0) == 55.0).all()


def correlations(kind: str, n: int) -> np.ndarray:
    """Correlations of a noise of variance 1, or 1 on average over a run."""
    i = np.arange(n)
    if kind == "half walk, half white":
        walk = np.minimum.outer(i, i) + 1.0
        centred = walk - walk.mean(axis=0)
        centred -= centred.mean(axis=1, keepdims=True)
        return 0.5 * walk / (np.trace(centred) / n) + 0.5 * np.eye(n)
    if kind == "1/f":
        power = 1.0 / np.maximum(np.arange(n // 2 + 1), 1.0)
        return toeplitz(np.fft.irfft(power, n) / np.fft.irfft(power, n)[0])
    return toeplitz(float(kind) ** i)


KINDS = ["half walk, half white", "1/f", "0.85", "0.4", "0.0"]


def noisy_runs(
    kind: str, theta: list[np.ndarray], sizes: np.ndarray, rng: np.random.Generator
) -> list[RunReadings]:
    """Runs of orders 1, 2 and 4 in a noise of 5."""
    runs = []
    for own in theta:
        root = np.linalg.cholesky(correlations(kind, own.size) + 1e-12 * np.eye(own.size))
        error = harmonics(own, [1, 2, 4]) @ sizes + 5.0 * root @ rng.normal(size=own.size)
        runs.append(RunReadings(own, error - 70.0, 3.0 + 0.02 * np.arange(own.size)))
    return runs


def best_known(kind: str, runs: list[RunReadings]) -> np.ndarray:
    """Generalized least squares with the true orders and the true noise."""
    gram, moment = np.zeros((6, 6)), np.zeros(6)
    for run in runs:
        known = cho_factor(correlations(kind, run.theta.size))
        whole = cho_solve(known, np.ones(run.theta.size))
        x = harmonics(run.theta, [1, 2, 4])
        x -= np.outer(np.ones(run.theta.size), whole @ x) / whole.sum()
        gram += x.T @ cho_solve(known, x)
        moment += x.T @ cho_solve(known, run.error)
    return np.linalg.solve(gram, moment)


@pytest.mark.parametrize("arc", [360.0, 200.0, 120.0])
def test_as_good_as_least_squares_that_knows_orders_and_noise(arc: float) -> None:
    """Two runs of 300 of 100, 40 and 15 among 12 orders; the set is exact over a turn."""
    span, places = math.radians(arc), np.linspace(0.05, 0.95, 60)
    phases, sizes = np.array([0.3, 1.1, 2.0]), np.array([100.0, 40.0, 15.0])
    sizes = np.stack([sizes * np.cos(phases), -sizes * np.sin(phases)], axis=1).ravel()
    columns = harmonics(span * places, [1, 2, 4])
    columns -= columns.mean(axis=0)
    ours, theirs, held = np.zeros((3, len(KINDS), 12))
    for kind, seed in itertools.product(range(len(KINDS)), range(12)):
        rng = np.random.default_rng(6400 + seed)
        theta = [np.sort(span * rng.beta(1.2, 1.2, 300))[::way] for way in (1, -1)]
        runs = noisy_runs(KINDS[kind], theta, sizes, rng)
        found = estimate_by_evidence(runs, range(1, 13))
        curve, std = found.curve(span * places)
        apart = curve - columns @ sizes
        ours[kind, seed] = np.mean(apart**2)
        theirs[kind, seed] = np.mean((columns @ (best_known(KINDS[kind], runs) - sizes)) ** 2)
        held[kind, seed] = np.mean(np.abs(apart) < 1.96 * std)
        assert arc < 360.0 or found.present == (1, 2, 4), (KINDS[kind], seed)
    assert ours.sum() <= 1.25**2 * theirs.sum()
    # Of each noise alone twelve pairs of runs scatter more.
    assert (ours.sum(axis=1) <= 1.4**2 * theirs.sum(axis=1)).all()
    assert held.mean() > 0.9


def test_over_an_arc_that_orders_fit_alike_the_interval_holds_the_curve() -> None:
    """Over 130 deg of autocorrelated noise, orders 1 and 4 alone fit these as well."""
    span, sizes = math.radians(130.0), np.array([60.0, -50.0, 20.0, 25.0, -12.0, 5.0])
    grid = np.linspace(0.05 * span, 0.95 * span, 60)
    columns = harmonics(grid, [1, 2, 4])
    wanted, held, apart = (columns - columns.mean(axis=0)) @ sizes, [], 0.0
    for seed in range(8):
        rng = np.random.default_rng(6450 + seed)
        theta = [np.sort(span * rng.beta(1.2, 1.2, 300))[::way] for way in (1, -1)]
        found = estimate_by_evidence(noisy_runs("0.85", theta, sizes, rng), range(1, 13))
        curve, std = found.curve(grid)
        held.append(np.mean(np.abs(curve - wanted) < 1.96 * std))
        apart += np.mean((curve - wanted) ** 2) / 8.0
    assert np.mean(held) > 0.9
    assert math.sqrt(apart) < 5.0


def test_what_differs_from_run_to_run_widens_the_interval() -> None:
    """Four runs whose order 1 differs by 6 each time: its interval holds the truth."""
    pulls, differs = [], 0
    for seed in range(15):
        rng = np.random.default_rng(6500 + seed)
        runs = []
        for _ in range(4):
            theta = rng.uniform(0.0, 2.0 * np.pi, 150)
            own = np.array([50.0, -20.0, 9.0, 3.0]) + np.r_[6.0 * rng.normal(size=2), 0.0, 0.0]
            noise = 2.0 * rng.normal(size=150)
            runs.append(RunReadings(theta, harmonics(theta, [1, 4]) @ own + noise))
        found = estimate_by_evidence(runs, range(1, 9))
        assert found.present == (1, 4)
        std = np.sqrt(np.diag(found.covariance))
        pulls += list((found.mean[:2] - [50.0, -20.0]) / std[:2])
        differs += found.models[0].omega[0] > 0.0
        assert std[2 * found.told.index(4)] < 0.25 * std[0]
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.4
    assert np.mean(np.abs(pulls) < 1.96) >= 0.9
    assert differs >= 14


def test_weights_and_orders_that_are_not_whole_are_those_of_scaled_columns() -> None:
    """A noise that is over the roots of the weights, and order 2.5: as in a dense covariance."""
    rng = np.random.default_rng(69)
    theta, error, time = scattered(rng, 80)
    weights = rng.gamma(2.0, 0.5, 80)
    run = RunReadings(theta, error, time, weights)
    log_evidence, mean, spread = Evidence([run], [2.5]).posterior(NOISES[0], [4.0], [0.0])
    x = np.stack([np.cos(2.5 * theta), np.sin(2.5 * theta)], axis=1)
    root = np.sqrt(np.outer(weights, weights))
    inverse = np.linalg.inv(covariance(NOISES[0], time) / root + 4.0 * x @ x.T)
    ones = np.ones(80)
    left = inverse - np.outer(inverse @ ones, ones @ inverse) / (ones @ inverse @ ones)
    np.testing.assert_allclose(mean, 4.0 * x.T @ left @ error, atol=1e-10)
    np.testing.assert_allclose(spread, 4.0 * np.eye(2) - 16.0 * x.T @ left @ x, atol=1e-10)
    plain = run._replace(weights=np.full(80, 1.0))
    again = Evidence([plain], [2.5]).posterior(NOISES[0], [4.0], [0.0])[0]
    assert (
        again == Evidence([run._replace(weights=None)], [2.5]).posterior(NOISES[0], [4.0], [0.0])[0]
    )
    assert again != log_evidence


@pytest.mark.parametrize("correlation", [0.0, 0.7])
def test_one_even_run_has_no_orders_that_are_noise(correlation: float) -> None:
    theta = np.linspace(0.0, 2.0 * np.pi, 144, endpoint=False)
    root = np.linalg.cholesky(toeplitz(correlation ** np.arange(144)))
    for seed in range(8):
        noise = root @ np.random.default_rng(6600 + seed).normal(size=144)
        run = RunReadings(theta, 9.0 * np.cos(theta + 1.0) + 5.0 * np.sin(2.0 * theta) + noise)
        assert estimate_by_evidence([run], range(1, 31)).present == (1, 2)


def test_orders_left_out_are_scored_beside_what_runs_differ_by() -> None:
    """Over even turns they have nothing in common with it: each is its mean over all readings."""
    rng, theta = np.random.default_rng(483), np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    sizes = rng.normal(40.0, 30.0, 4)
    errors = [a * np.cos(theta) + 9.0 * np.sin(2.0 * theta) for a in sizes]
    errors = [error + rng.normal(0.0, 2.0, 360) for error in errors]
    found = estimate_by_evidence([RunReadings(theta, error) for error in errors], range(1, 60))
    assert found.models[0].omega[0] > 0.0
    for order, own in zip(found.orders[2:], found.alone[2:], strict=True):
        assert own is not None, order
        mean = 2.0 * np.mean(errors, axis=0) @ harmonics(theta, [order]) / 360.0
        off = mean - [own.cosine, own.sine]
        assert np.all(np.abs(off) < 0.5 * np.sqrt([own.cosine_variance, own.sine_variance])), order


@pytest.mark.parametrize("power", [0.5, 1.0])
def test_errors_of_one_run_hold_in_slow_noise(power: float) -> None:
    """Whose spectrum falls with a power of the frequency: 1/f noise, and a walk."""
    theta, orders = np.arange(900) * math.radians(0.4), (1, 2, 5)
    frequency = np.fft.rfftfreq(8 * 900)[1:]
    pulls, false = [], 0
    for seed in range(30):
        rng = np.random.default_rng([480, seed])
        waves = np.append(
            0.0, rng.normal(size=(2, frequency.size)).T @ (1.0, 1j) / frequency**power
        )
        noise = np.fft.irfft(waves)[:900]
        noise = 3.0 * noise / noise.std() + rng.normal(size=900)
        truth = rng.normal(0.0, 40.0, 6)
        run = RunReadings(theta, harmonics(theta, orders) @ truth + noise, 0.01 * np.arange(900.0))
        found = estimate_by_evidence([run], range(1, 41))
        false += not {*found.present} <= {*orders}
        own = np.repeat([2 * found.told.index(m) for m in orders], 2) + [0, 1] * 3
        pulls.append((found.mean[own] - truth) / np.sqrt(np.diag(found.covariance)[own]))
    assert 0.85 < np.sqrt(np.mean(np.square(pulls))) < 1.25
    assert false <= 2


def test_a_probability_is_no_more_than_one() -> None:
    """The weights of many models add up to 1 but for their rounding."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        theta = np.sort(rng.uniform(0.0, 2.0 * np.pi, 120))
        error = 40.0 * np.cos(theta) + 20.0 * np.sin(5.0 * theta)
        path = 0.3 * np.cumsum(rng.normal(size=(2, 120)), axis=1) + rng.normal(size=(2, 120))
        estimate = estimate_by_evidence(
            [RunReadings(theta, error + own) for own in path], range(1, 13)
        )
        for found in (estimate, estimate.without([0])):
            assert ((found.probability >= 0.0) & (found.probability <= 1.0)).all()


def test_orders_that_the_places_cannot_distinguish_share_their_probability() -> None:
    """At 16 places orders 3 and 13 are the same columns."""
    theta = np.tile(2.0 * np.pi * np.arange(16) / 16, 8)
    rng = np.random.default_rng(67)
    run = RunReadings(theta, 6.0 * np.cos(3.0 * theta) + rng.normal(size=theta.size))
    equal = estimate_by_evidence([run], [1, 3, 13])
    assert equal.probability[1] == pytest.approx(equal.probability[2], abs=1e-6)
    assert equal.probability[1:].sum() > 0.99
    unequal = estimate_by_evidence([run], [1, 3, 13], [0.3, 0.3, 0.01])
    assert unequal.present == (3,)
    # Where they were read, the curve is known although the order is not.
    places = theta[:16]
    curve, std = equal.curve(places)
    np.testing.assert_allclose(curve, 6.0 * np.cos(3.0 * places), atol=1.0)
    assert std.max() < 0.5
    between, wide = equal.curve(places + np.pi / 16)
    assert wide.max() > 2.0
    assert np.abs(between).max() < 6.0


def test_an_order_left_out_is_held_by_those_it_looks_like() -> None:
    """Over 40 deg orders 1 and 2 hold what order 3 makes there, mean and band."""
    theta = np.radians(np.linspace(0.0, 40.0, 200))
    rng = np.random.default_rng(70)
    run = RunReadings(theta, 6.0 * np.cos(3.0 * theta + 0.4) + 0.1 * rng.normal(size=200))
    found = estimate_by_evidence([run], [1, 2, 3])
    mean, spread = found.among([1, 2], theta)
    columns = harmonics(theta, [1, 2])
    columns -= columns.mean(axis=0)
    curve, std = found.curve(theta)
    assert np.sqrt(np.mean((columns @ mean - curve) ** 2)) < std.mean()
    own = np.sqrt(np.einsum("ij,jk,ik->i", columns, spread, columns))
    np.testing.assert_allclose(own, std, rtol=0.2, atol=0.005)
    # All of them are themselves, and those beside are left away.
    every, _ = found.among(found.told, theta)
    np.testing.assert_array_equal(every, found.mean)
    assert not found.among([1], theta, beside=[k for k in found.told if k != 1])[0][2:].any()


def test_the_noise_is_that_of_the_readings() -> None:
    """White and one term, both from long runs: each variance to a quarter."""
    rng = np.random.default_rng(68)
    decay = math.exp(-1.0 / CORRELATION_TIMES[1])
    runs = []
    for _ in range(3):
        drift = np.zeros(4000)
        drift[0] = 3.0 * rng.normal()
        for i in range(1, 4000):
            drift[i] = decay * drift[i - 1] + 3.0 * math.sqrt(1.0 - decay**2) * rng.normal()
        theta = np.linspace(0.0, 30.0, 4000)
        runs.append(RunReadings(theta, 8.0 * np.cos(theta) + drift + rng.normal(size=4000)))
    evidence = Evidence(runs, [1, 2])
    white, *terms = evidence.noise([64.0, 64.0], [0.0, 0.0], 10.0)
    assert white == pytest.approx(1.0, rel=0.25)
    assert terms[1] == pytest.approx(9.0, rel=0.25)
    assert sum(terms) - terms[1] < 1.0
    assert evidence.estimate([0.5, 0.5])[4][2] == pytest.approx(terms[1], rel=0.1)


def test_what_cannot_be_used_is_refused_with_the_run_and_the_reading() -> None:
    good = RunReadings(np.arange(4.0), np.arange(4.0) ** 2)
    back = RunReadings(np.arange(3.0), np.zeros(3), np.array([0.0, 2.0, 1.0]))
    with pytest.raises(ArgumentError, match=r"runs\[1\]: time\[2\] .* got 1 after 2; pass no time"):
        estimate_by_evidence([good, back], [1])
    assert estimate_by_evidence([good, back._replace(time=None)], [1]).orders == (1,)
    for wrong, message in (
        (RunReadings(np.arange(3.0), np.zeros(2)), r"runs\[0\]: error has 2 elements"),
        (RunReadings(np.arange(2.0), np.array([1.0, np.nan])), r"runs\[0\]: error\[1\] must be"),
        (RunReadings(np.zeros(0), np.zeros(0)), "at least 1 reading"),
    ):
        with pytest.raises(ArgumentError, match=message):
            estimate_by_evidence([wrong], [1])
    with pytest.raises(ArgumentError, match="at least 1 run"):
        estimate_by_evidence([], [1])
    with pytest.raises(ArgumentError, match=r"increasing order, got orders\[1\] = 2 after 2"):
        estimate_by_evidence([good], [2, 2])
    with pytest.raises(ArgumentError, match=r"orders must be positive, .* got orders\[0\] = -2"):
        estimate_by_evidence([good], [-2])
    weighted = good._replace(weights=np.array([1.0, 0.0, 1.0, 1.0]))
    with pytest.raises(ArgumentError, match=r"runs\[0\]: weights\[1\]"):
        estimate_by_evidence([weighted], [1])
    with pytest.raises(ArgumentError, match="above 0 and below 1, got 1"):
        estimate_by_evidence([good], [2], [1.0])
    with pytest.raises(ArgumentError, match="probabilities has 2 elements, orders has 1"):
        estimate_by_evidence([good], [2], [0.1, 0.1])
    evidence = Evidence([good], [1])
    for noise in ([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0, 0.0, 0.0]):
        with pytest.raises(ArgumentError, match="noise"):
            evidence.posterior(noise, [1.0], [0.0])
    with pytest.raises(ArgumentError, match="tau has 2 elements"):
        evidence.posterior(NOISES[1], [1.0, 2.0], [0.0])
    with pytest.raises(ArgumentError, match="scale must be above 0"):
        evidence.noise([1.0], [0.0], 0.0)


def test_noise_beside_many_columns_is_that_of_what_they_leave():
    """Beyond 144 columns of 12 000 readings none is projected out: 4 000 had taken over 5 min."""
    rng = np.random.default_rng(18)
    theta = rng.uniform(0.0, 2.0 * np.pi, 12_000)
    noise = np.zeros(theta.size)
    for i, step in enumerate(rng.normal(size=theta.size - 1)):
        noise[i + 1] = 0.8 * noise[i] + step
    found = []
    for orders in (72, 73):
        waves = np.multiply.outer(theta, np.arange(1.0, orders + 1.0))
        columns = np.column_stack([np.cos(waves), np.sin(waves)])
        left = noise - columns @ np.linalg.lstsq(columns, noise, rcond=None)[0]
        found.append(CorrelatedNoise.of([columns], [left], left @ left / (theta.size - 2 * orders)))
    near, other = (noise.covariances(theta.size)[:20] for noise in found)
    np.testing.assert_allclose(other / near[0], near / near[0], atol=0.03)
    np.testing.assert_allclose(near[:3] / near[0], [1.0, 0.8, 0.64], atol=0.05)
