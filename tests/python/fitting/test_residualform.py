"""How white noise correlates once a fit has taken its orders: by all matrices, and by chance."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.correlation import ResidualSpace, correlation_found

SEED = 91_300

#: Fits of a design: of true 1 % some 5 in 150 are told once in 4000.
FITS = 150


def white(rng, places, runs, weights=None):
    sigma = 0.2 if weights is None else 0.2 / np.sqrt(weights)
    line = 0.01 * np.cos(np.radians(places))
    return [
        ta.CalibrationRun(
            places,
            places + line + sigma / 3600.0 * rng.normal(size=places.size) + zero,
            360.0,
            weights=weights,
        )
        for zero in rng.normal(size=runs)
    ]


def of(fit):
    used = range(len(fit.problem.runs))
    return ResidualSpace.of(fit.problem, fit.problem.base, used)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("orders", [[1, 2, 3], [1, 7, 9, 10, 11], list(range(1, 11))])
def test_shares_are_those_of_the_matrices_written_out(orders, weighted):
    """M = I - X (X'X)^-1 X' with all its n x n numbers, A with its ones."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    places = 15.0 * np.arange(24)
    weights = rng.uniform(0.3, 3.0, 24) if weighted else None
    fit = ta.fit(white(rng, places, 2, weights), orders=orders)
    x = np.radians(places)[:, None] * orders
    one = np.hstack([np.cos(x), np.sin(x)])
    if weighted:
        one *= np.sqrt(weights)[:, None]
    zero = np.ones((24, 1)) if weights is None else np.sqrt(weights)[:, None]
    design = np.hstack([np.kron(np.eye(2), zero), np.vstack([one, one])])
    m = np.eye(48) - design @ np.linalg.pinv(design)
    step = 0.5 * (np.eye(24, k=1) + np.eye(24, k=-1))
    forms = {
        "neighbours": np.kron(np.eye(2), step),
        "means": np.kron(np.eye(6), np.full((8, 8), 1.0 / 8.0)),
    }
    for name, a in forms.items():
        told = of(fit).neighbours() if name == "neighbours" else of(fit).means(8)
        left = np.trace(m)
        mean = np.trace(m @ a) / left
        variance = 2.0 * (np.trace(m @ a @ m @ a) - np.trace(m @ a) ** 2 / left) / left**2
        assert told.expected == pytest.approx(mean, abs=1e-12)
        assert told.deviation == pytest.approx(math.sqrt(variance), rel=1e-9)


def test_readings_that_fill_no_stretch_are_left_out_of_its_means():
    rng = np.random.default_rng(SEED + 1)
    fit = ta.fit(white(rng, 10.0 * np.arange(36), 1), orders=[1])
    x = np.radians(10.0 * np.arange(36))
    design = np.column_stack([np.ones(36), np.cos(x), np.sin(x)])
    m = np.eye(36) - design @ np.linalg.pinv(design)
    a = np.zeros((36, 36))
    for start in range(0, 32, 8):
        a[start : start + 8, start : start + 8] = 1.0 / 8.0
    assert of(fit).means(8).expected == pytest.approx(np.trace(m @ a) / 33.0, abs=1e-12)


@pytest.mark.parametrize(
    ("count", "runs", "orders"),
    [(24, 2, range(1, 12)), (30, 2, range(1, 15)), (60, 3, range(1, 27)), (48, 2, range(8, 23))],
)
def test_many_orders_leave_white_noise_white(count, runs, orders):
    """Of 36 places twice 66 of 100 had been "not white", by +0.5 that was added to 0.0."""
    print("seed", SEED + count)
    places = 360.0 / count * np.arange(count)
    told = 0
    pulls = []
    for seed in range(FITS):
        rng = np.random.default_rng([SEED + count, seed])
        fit = ta.fit(white(rng, places, runs), orders=[1, *(k for k in orders if k > 1)])
        used = range(runs)
        told += bool(correlation_found(fit.problem, fit.fitted, fit.problem.base, used))
        values = np.ravel(np.column_stack([fit.model.shafts[0].cosine, fit.model.shafts[0].sine]))
        values[0] -= 0.01
        pulls.append(values / np.sqrt(np.diag(fit.covariance))[1:])
    assert told <= 5
    assert np.median(np.abs(pulls)) / 0.6745 == pytest.approx(1.0, abs=0.12)


def test_low_orders_hide_no_correlation():
    """Noise that remembers: found beside 1 order and beside 8, where they leave it too low."""
    print("seed", SEED)
    found = {1: 0, 8: 0}
    places = 5.0 * np.arange(72)
    for seed in range(40):
        rng = np.random.default_rng([SEED, seed])
        runs = []
        for _ in range(2):
            noise = rng.normal(size=72)
            for i in range(1, 72):
                noise[i] += 0.6 * noise[i - 1]
            runs.append(ta.CalibrationRun(places, places + noise / 3600.0, 360.0))
        for most in found:
            fit = ta.fit(runs, orders=range(1, most + 1))
            said = correlation_found(fit.problem, fit.fitted, fit.problem.base, range(2))
            found[most] += said.startswith("neighbours")
    assert found[1] >= 38
    assert found[8] >= 34
