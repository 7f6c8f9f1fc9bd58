"""A fit under a prior against dense matrices of all readings, every run's zero free beside them."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.prior import Prior
from trueangle.joint.shafts import ShaftOrders

SEED = 51_200
SHAFTS = (ShaftOrders("output", 1.0, (1, 3)), ShaftOrders("motor", 7.0, (1,)))
NOISE = 2e-5


def prior_of(unit, freedom=np.inf, spread=(3e-5, 3e-5, 1e-6, 1e-6, 2e-4, 2e-4)):
    mean = np.array([1e-4, -5e-5, 0.0, 2e-5, -1e-4, 3e-5]) * unit
    variance = (np.array(spread) * unit) ** 2
    return Prior(unit, SHAFTS, mean, variance, 60.0, (NOISE * unit) ** 2, freedom, 40)


def runs_of(unit, weighted, count=3):
    """Runs of unlike lengths over parts of a turn, so that zeros and orders hang together."""
    rng = np.random.default_rng(SEED)
    runs = []
    for number in range(count):
        turn = np.sort(rng.uniform(0.0, 0.5 + 0.15 * number, 14 + 9 * number))
        error = 1.2e-4 * np.cos(2.0 * np.pi * turn) + 8e-5 * np.sin(14.0 * np.pi * turn + 0.3)
        error += NOISE * rng.normal(size=turn.size) + 1e-4 * (number - 1)
        weights = rng.uniform(0.3, 2.0, turn.size) if weighted else None
        runs.append(ta.CalibrationRun(unit * turn, unit * (turn + error), unit, weights=weights))
    return runs


def dense(runs, prior, noise):
    """Estimate and covariance of every run's zero and all coefficients."""
    size = len(runs)
    hessian = np.zeros((size + 6, size + 6))
    target = np.zeros(size + 6)
    with np.errstate(divide="ignore"):
        precision = 1.0 / prior.variance
    hessian[size:, size:] = np.diag(precision)
    target[size:] = precision * prior.mean
    for number, run in enumerate(runs):
        x = 2.0 * np.pi / run.period * run.reference
        zeros = np.zeros((len(run), size))
        zeros[:, number] = 1.0
        waves = [f(k * x) for k in (1.0, 3.0, 7.0) for f in (np.cos, np.sin)]
        rows = np.column_stack([zeros, *waves])
        weight = np.ones(len(run)) if run.weights is None else run.weights
        hessian += (rows.T * weight) @ rows / noise
        target += (rows.T * weight) @ run.centred_error / noise
    inverse = np.linalg.inv(hessian)
    return inverse @ target, inverse


@pytest.mark.parametrize("unit", [360.0, 2.0 * np.pi, 1.0])
@pytest.mark.parametrize("weighted", [False, True])
def test_zeros_coefficients_and_how_they_hang_together(weighted, unit):
    """The constant is the mean of the zeros: its row and column of the covariance as well."""
    runs, prior = runs_of(unit, weighted), prior_of(unit)
    fit = ta.fit(runs, prior=prior, loss="linear")
    estimate, inverse = dense(runs, prior, prior.noise_variance)
    mean = np.zeros((7, 9))
    mean[0, :3] = 1.0 / 3.0
    mean[1:, 3:] = np.eye(6)
    wanted = mean @ inverse @ mean.T
    scale = np.sqrt(np.diag(wanted))
    np.testing.assert_allclose(fit.covariance / np.outer(scale, scale),
                               wanted / np.outer(scale, scale), atol=1e-8)  # fmt: skip
    # The constant hangs together with the orders here: a wrong sign would be seen.
    assert np.max(np.abs(wanted[0, 1:]) / (scale[0] * scale[1:])) > 0.3
    np.testing.assert_allclose(fit.offset_std, np.sqrt(np.diag(inverse)[:3]), rtol=1e-7)
    np.testing.assert_allclose(fit.offsets / unit, estimate[:3] / unit, atol=1e-10)
    found = [[a, b] for s in fit.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    np.testing.assert_allclose(np.ravel(found) / unit, estimate[3:] / unit, atol=1e-10)
    assert fit.model.constant == pytest.approx(float(np.mean(estimate[:3])), abs=1e-9 * unit)
    own = 1.0 - np.diag(inverse)[3:] / prior.variance
    np.testing.assert_allclose(fit.posterior.own, own.reshape(3, 2).mean(axis=1), rtol=1e-7)


@pytest.mark.parametrize("freedom", [5.0, 500.0])
def test_the_noise_of_few_degrees_of_freedom_is_put_right_by_the_readings(freedom):
    """Both add up: squares and degrees of freedom, those left by what the readings decide."""
    runs, prior = runs_of(360.0, False), prior_of(360.0, freedom)
    runs = [
        ta.CalibrationRun(r.reference, r.reference + r.zero + 4.0 * (r.centred_error - r.zero), 360)
        for r in runs
    ]
    fit = ta.fit(runs, prior=prior, loss="linear")
    noise = fit.posterior.noise**2
    estimate, inverse = dense(runs, prior, noise)
    left = 0.0
    spent = 3.0 + float(np.sum(1.0 - np.diag(inverse)[3:] / prior.variance))
    for number, run in enumerate(runs):
        x = 2.0 * np.pi / 360.0 * run.reference
        waves = np.column_stack([f(k * x) for k in (1.0, 3.0, 7.0) for f in (np.cos, np.sin)])
        rest = run.centred_error - estimate[number] - waves @ estimate[3:]
        left += float(rest @ rest)
    free = sum(map(len, runs)) - spent
    wanted = (freedom * prior.noise_variance + left) / (freedom + free)
    assert noise == pytest.approx(wanted, rel=1e-6)
    assert fit.posterior.freedom == pytest.approx(min(60.0, freedom + free), rel=1e-6)
    np.testing.assert_allclose(np.diag(fit.covariance)[1:], np.diag(inverse)[3:], rtol=1e-6)


@pytest.mark.parametrize("unit", [360.0, 1.0])
def test_an_order_that_no_unit_has_of_its_own_is_that_of_all(unit):
    """Without a variance it is known, and the rest is as with a very small one."""
    runs = runs_of(unit, True)
    spread = (3e-5, 3e-5, 0.0, 0.0, 2e-4, 2e-4)
    known = ta.fit(runs, prior=prior_of(unit, spread=spread), loss="linear")
    tiny = tuple(s or 1e-10 for s in spread)
    nearly = ta.fit(runs, prior=prior_of(unit, spread=tiny), loss="linear")
    shaft = known.model.shafts[0]
    assert (shaft.cosine[1], shaft.sine[1]) == (0.0, pytest.approx(2e-5 * unit))
    assert np.all(known.covariance[[3, 4]] == 0.0)
    np.testing.assert_allclose(known.amplitudes, nearly.amplitudes, rtol=1e-6)
    np.testing.assert_allclose(known.offset_std, nearly.offset_std, rtol=1e-6)
    others = np.ix_([0, 1, 2, 5, 6], [0, 1, 2, 5, 6])
    scale = np.abs(nearly.covariance[others]).max()
    np.testing.assert_allclose(known.covariance[others] / scale,
                               nearly.covariance[others] / scale, atol=1e-7)  # fmt: skip
    assert known.posterior.own[1] == 0.0


def test_what_runs_differ_by_widens_errors_as_it_moves_the_estimate():
    """Each run's own coefficients, one by one: the fit is linear in the readings."""
    runs = runs_of(360.0, False)
    prior = prior_of(360.0)
    between = (np.array([3e-6, 3e-6, 0.0, 0.0, 4e-5, 4e-5]) * 360.0) ** 2

    def told(readings, known):
        fit = ta.fit(readings, prior=known, loss="linear")
        pairs = [(a, b) for s in fit.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
        return fit, np.array([fit.model.constant, *np.ravel(pairs)])

    plain, found = told(runs, prior)
    wider, same = told(runs, replace(prior, run_variance=between))
    np.testing.assert_array_equal(same, found)
    wanted = plain.covariance.copy()
    for i, run in enumerate(runs):
        x = 2.0 * np.pi / run.period * run.reference
        waves = [f(k * x) for k in (1.0, 3.0, 7.0) for f in (np.cos, np.sin)]
        for wave, variance in zip(waves, between, strict=True):
            moved = [*runs]
            moved[i] = replace(run, indicated=run.indicated + 1e-3 * wave)
            slope = (told(moved, prior)[1] - found) / 1e-3
            wanted += variance * np.outer(slope, slope)
    assert (np.diag(wider.covariance) > 1.05 * np.diag(plain.covariance))[5:].all()
    # The constant is a circular mean, and no line.
    np.testing.assert_allclose(wider.covariance, wanted, rtol=1e-5, atol=1e-9 * wanted.max())
