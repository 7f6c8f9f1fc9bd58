"""Standard errors of robust losses: pulls over noises, and Huber's formula written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.fitting.robust import HUBER, TUKEY
from trueangle.runs.outliers import MAD_TO_SIGMA

SEED = 72_900

#: Fits of a design, and how far the root mean square of 2 x 150 pulls may be from 1: three times
#: sqrt(1 / 600), and what few readings tell of a scale.
FITS, AWAY = 150, 0.16


def read(rng, count, runs, noise, outliers=0):
    places = 360.0 / count * np.arange(count)
    found = []
    for zero in rng.normal(0.0, 4.0, runs):
        error = 30.0 * np.cos(np.radians(places)) + zero
        error += (
            0.7 * rng.normal(size=count) if noise == "normal" else rng.logistic(0.0, 0.4, count)
        )
        hit = rng.choice(count, outliers, replace=False)
        error[hit] += rng.choice([-1.0, 1.0], outliers) * rng.uniform(30.0, 90.0, outliers)
        found.append(ta.CalibrationRun(places, places + error / 3600.0, 360.0))
    return found


@pytest.mark.parametrize("loss", ["huber", "tukey"])
@pytest.mark.parametrize(
    ("count", "runs", "noise", "outliers"),
    [(30, 2, "normal", 0), (40, 2, "normal", 2), (48, 1, "logistic", 0), (45, 5, "normal", 3)],
)
def test_pulls_are_those_of_the_noise(loss, count, runs, noise, outliers):
    """Of huber with two outliers in 36 readings they had been 0.37, its errors far too wide."""
    print("seed", SEED)
    z = []
    for seed in range(FITS):
        rng = np.random.default_rng([SEED, count, seed])
        fit = ta.fit(read(rng, count, runs, noise, outliers), orders=[1], loss=loss)
        shaft = fit.model.shafts[0]
        off = np.array([shaft.cosine[0] - 30.0 / 3600.0, shaft.sine[0]])
        # Of few runs the errors are known by few degrees of freedom: as of a normal distribution.
        student = stats.t.cdf(off / np.sqrt(np.diag(fit.covariance))[1:], fit.freedom[1:])
        z.append(stats.norm.ppf(student))
    assert abs(math.sqrt(np.mean(np.square(z))) - 1.0) < AWAY, np.std(z, axis=0)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_white_covariances_are_hubers(loss, weighted):
    """By psi and its slope as they are defined, and the sums of all readings."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    (run,) = read(rng, 400, 1, "normal", 12)
    b = rng.uniform(0.5, 2.0, 400) if weighted else np.ones(400)
    run = ta.CalibrationRun(run.reference, run.indicated, 360.0, weights=b if weighted else None)
    fit = ta.fit(run, orders=[1, 2], loss=loss, covariance="white")
    rest = fit.residuals
    scale = MAD_TO_SIGMA * np.median(np.abs(rest))
    d = rest / scale
    if loss == "huber":
        psi, slope = np.clip(d, -HUBER, HUBER), (np.abs(d) < HUBER).astype(float)
    else:
        u = np.square(d / TUKEY)
        psi = np.where(u < 1.0, d * (1.0 - u) ** 2, 0.0)
        slope = np.where(u < 1.0, (1.0 - u) * (1.0 - 5.0 * u), 0.0)
    mean = np.average(slope, weights=b)
    few = 1.0 + 5.0 / 400.0 * np.average((slope - mean) ** 2, weights=b) / mean**2
    x = np.radians(run.reference)
    design = np.column_stack([np.ones(400), np.cos(x), np.sin(x), np.cos(2 * x), np.sin(2 * x)])
    inverse = np.linalg.inv(design.T @ (b[:, None] * design))
    wanted = inverse * few**2 * scale**2 * (b @ psi**2 / 395.0) / mean**2
    errors = np.sqrt(np.diag(fit.covariance) / np.diag(wanted))
    # Which of the orders a weight falls on is told by neither: 400 weights, of 12 outliers.
    np.testing.assert_allclose(errors[1:], 1.0, atol=0.06)
    assert np.mean(errors[1:]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("loss", ["linear", "auto"])
def test_least_squares_stay_as_they_are(loss):
    rng = np.random.default_rng(SEED + 2)
    fit = ta.fit(read(rng, 36, 2, "normal", 1 if loss == "auto" else 0), orders=[1], loss=loss)
    plain = np.asarray(fit.fitted.solution.covariance)
    np.testing.assert_array_equal(fit.covariance, plain)
