"""What a nuisance fitted beside a pattern costs it: pulls, and one joint fit written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta

SEED = 72_400

#: Fits of a design, and how far the root mean square of their 2 x 120 pulls may be from that
#: of Student's distribution: sqrt(1 / (2 x 240)) = 0.05 and three times that.
FITS, AWAY = 120, 0.15


def read(rng, runs, count=40, drift=0.0, play=0.0, step=None, noise=0.6, back=False):
    """Degrees; a line of 30 arcsec, noise, a bend in time or a play, own zeros."""
    places = (360.0 / count if step is None else step) * np.arange(count)
    if back:
        places = np.concatenate([places, places[::-1]])
    # Where it turns it stands, and has come from before.
    way = np.where(np.arange(places.size) <= count, 1.0, -1.0)
    since = np.linspace(0.0, 1.0, places.size)
    found = []
    for zero in rng.normal(0.0, 4.0, runs):
        error = 30.0 * np.sin(np.radians(places)) + drift * np.sin(2.0 * since) + play * way
        error += noise * rng.normal(size=places.size) + zero
        found.append(ta.CalibrationRun(places, places + error / 3600.0, 360.0, time=40.0 * since))
    return found


def pulls(kinds, **design):
    found, freedom = [], 0.0
    for seed in range(FITS):
        rng = np.random.default_rng([SEED, seed, design["runs"]])
        fit = ta.fit(read(rng, **design), orders=[1], nuisance=kinds)
        shaft = fit.model.shafts[0]
        off = np.array([shaft.cosine[0], shaft.sine[0] - 30.0 / 3600.0])
        found.append(off / np.sqrt(np.diag(fit.covariance))[1:])
        freedom += float(fit.freedom[1:].min()) / FITS
    return np.array(found), freedom


@pytest.mark.parametrize(
    ("kinds", "design"),
    [
        (["drift"], {"runs": 2, "count": 60}),
        (["drift"], {"runs": 8, "drift": 2.0}),
        (["drift"], {"runs": 10}),
        (["ramp"], {"runs": 1, "count": 30, "step": 7.0}),
        (["ramp", "direction"], {"runs": 4, "count": 20, "step": 6.0, "play": 3.0, "back": True}),
    ],
)
def test_pulls_are_students(kinds, design):
    """Ten runs that each drift by themselves: off by 5.7 standard errors (rms), a third inside."""
    print("seed", SEED)
    z, freedom = pulls(kinds, **design)
    wanted = math.sqrt(freedom / (freedom - 2.0))
    assert abs(math.sqrt(np.mean(z**2)) - wanted) < AWAY, (z.std(axis=0), wanted)


@pytest.mark.parametrize("weighted", [False, True])
def test_it_is_the_covariance_of_one_fit_of_all(weighted):
    """Columns of zeros, pattern, ramp and direction in one matrix, by the normal equations."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    runs = read(rng, 2, count=18, step=9.0, play=2.0, back=True)
    w = rng.uniform(0.4, 2.0, 36) if weighted else np.ones(36)
    runs = [
        ta.CalibrationRun(run.reference, run.indicated, 360.0, weights=w if weighted else None)
        for run in runs
    ]
    fit = ta.fit(runs, orders=[1, 2], nuisance=["ramp", "direction"], covariance="white", ridge=0.0)
    x = np.radians(runs[0].reference)
    columns = np.column_stack(
        [np.cos(x), np.sin(x), np.cos(2 * x), np.sin(2 * x), x, runs[0].direction]
    )
    design = np.hstack([np.kron(np.eye(2), np.ones((36, 1))), np.vstack([columns, columns])])
    both = np.tile(w, 2)
    inverse = np.linalg.inv(design.T @ (both[:, None] * design))
    target = np.concatenate([run.error for run in runs])
    b = inverse @ design.T @ (both * target)
    rest = target - design @ b
    wanted = inverse * (both @ rest**2 / (72 - 8))
    shaft = fit.model.shafts[0]
    found = np.ravel(np.column_stack([shaft.cosine, shaft.sine]))
    np.testing.assert_allclose(found, b[2:6], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        fit.covariance[1:, 1:], wanted[2:6, 2:6], rtol=1e-6, atol=1e-9 * wanted.max()
    )
    assert fit.freedom == pytest.approx(np.full(5, 64.0))
    assert fit.covariance.shape == (5, 5)


def test_as_many_unknowns_as_readings_have_no_covariance():
    rng = np.random.default_rng(SEED + 2)
    fit = ta.fit(read(rng, 1, count=6), orders=[1], nuisance=["drift"])
    assert fit.model.covariance is None
