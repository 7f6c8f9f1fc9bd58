"""The slow truth against finite differences, its own inverse and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.estimation import reference
from trueangle.joint.shafts import Shaft
from trueangle.model.model import HarmonicModel

UNITS = (360.0, 2.0 * math.pi, 1.0, 4096.0)


def model(period: float, argument: str = "reference") -> HarmonicModel:
    scale = period / 360.0
    return HarmonicModel(
        (
            Shaft("output", 1.0, (1, 3), (0.2 * scale, -0.1 * scale), (0.05 * scale, 0.3 * scale)),
            Shaft("motor", 50.5, (2,), (0.01 * scale,), (-0.02 * scale,)),
        ),
        0.4 * scale,
        period,
        argument,
    )


@pytest.mark.parametrize("period", UNITS)
def test_error_and_slope_in_every_unit(period: float) -> None:
    given = model(period)
    theta = np.linspace(-1.3, 2.1, 50) * period
    x = theta / period * 2.0 * math.pi
    expected = 0.4 + 0.2 * np.cos(x) + 0.05 * np.sin(x) - 0.1 * np.cos(3 * x) + 0.3 * np.sin(3 * x)
    expected += 0.01 * np.cos(101 * x) - 0.02 * np.sin(101 * x)
    np.testing.assert_allclose(reference.error(given, theta) / period * 360.0, expected, atol=1e-9)
    h = 1e-7 * period
    slope = (reference.error(given, theta + h) - reference.error(given, theta - h)) / (2.0 * h)
    np.testing.assert_allclose(reference.slope(given, theta), slope, atol=1e-6)


@pytest.mark.parametrize("period", UNITS)
def test_correction_takes_the_error_off(period: float) -> None:
    given = model(period)
    theta = np.linspace(-1.3, 2.1, 50) * period
    back = reference.correct(given, theta + reference.error(given, theta))
    np.testing.assert_allclose(back, theta, atol=1e-12 * period)
    other = model(period, "indicated")
    np.testing.assert_array_equal(
        reference.correct(other, theta), theta - reference.error(other, theta)
    )


def test_the_design_has_its_columns_in_order() -> None:
    theta = np.array([0.1, 0.7])
    x = 2.0 * math.pi * theta
    found = reference.design_matrix(theta, [(1.0, [1, 2]), (3.5, [2])], 1.0)
    phases = (x, 2.0 * x, 7.0 * x)
    expected = [np.ones(2), *(f(p) for p in phases for f in (np.cos, np.sin))]
    np.testing.assert_allclose(found, np.stack(expected, axis=1))
    assert reference.design_matrix(theta, [(1.0, [1])], 1.0, constant=False).shape == (2, 2)
    assert reference.design_matrix(theta, [], 1.0, constant=False).shape == (2, 0)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_fit_finds_what_is_hidden_with_its_spread(argument: str) -> None:
    """On equal steps of whole turns the covariance is known: 2 sigma^2 / n of a coefficient."""
    pulls, zeros = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        grid = np.arange(0.0, 720.0, 5.0)
        error = 0.3 * np.cos(np.radians(grid)) + rng.normal(0.0, 0.01, grid.size)
        angles = {"reference": grid, "indicated": grid + error}
        if argument == "indicated":
            angles = {"reference": grid - error, "indicated": grid}
        runs = [
            CalibrationRun(angles["reference"], angles["indicated"] + zero, 360.0)
            if argument == "reference"
            else CalibrationRun(angles["reference"] - zero, angles["indicated"], 360.0)
            for zero in (0.0, 2.0)
        ]
        found = reference.fit(runs, [(1.0, [1])], argument)
        std = np.sqrt(np.diag(found.covariance))
        pulls.append((found.coefficients - [0.3, 0.0]) / std)
        zeros.append(found.offsets)
        freedom = 2 * grid.size - 4
        sigma = math.sqrt(found.residuals @ found.residuals / freedom)
        np.testing.assert_allclose(std, sigma * math.sqrt(2.0 / (2 * grid.size)), rtol=1e-6)
    np.testing.assert_allclose(np.mean(zeros, axis=0), [0.0, 2.0], atol=0.002)
    # Both runs have the same noise here: pulls are 2 ** 0.5 as wide.
    assert 0.85 < np.std(pulls) / math.sqrt(2.0) < 1.15
    assert abs(np.mean(pulls)) < 0.4


def test_whole_weights_are_repeated_readings_and_none_is_none() -> None:
    rng = np.random.default_rng(3)
    theta = rng.uniform(0.0, 360.0, 60)
    error = 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 0.01, 60)
    weights = rng.integers(0, 3, 60)
    weighed = reference.fit(
        CalibrationRun(theta, theta + error, 360.0, weights=weights), [(1.0, [1])]
    )
    again = np.repeat(np.arange(60), weights)
    repeated = reference.fit(
        CalibrationRun(theta[again], theta[again] + error[again], 360.0), [(1.0, [1])]
    )
    np.testing.assert_allclose(weighed.coefficients, repeated.coefficients, atol=1e-9)
    # Of their covariance, that of as many degrees of freedom as readings have a weight.
    share = (again.size - 3) / (np.count_nonzero(weights) - 3)
    np.testing.assert_allclose(weighed.covariance, share * repeated.covariance, rtol=1e-6)
    few = np.array([0.0, 100.0, 200.0])
    assert np.isnan(reference.fit(CalibrationRun(few, few, 360.0), [(1.0, [1])]).covariance).all()
