"""A unit from few readings: the prior's estimate, its intervals, and measured motors."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, KindError

from .made import ARCSEC, MEAN, pattern, units

SEED = 52_040


def few(rng, own, count, noise=3.0):
    """A run of readings at random places."""
    places = np.sort(rng.uniform(0.0, 360.0, count))
    error = pattern(own, places) + ARCSEC * (7.0 + rng.normal(0.0, noise, count))
    return ta.CalibrationRun(places, places + error, 360.0)


def known(fit):
    (shaft,) = fit.model.shafts
    return np.column_stack([shaft.cosine, shaft.sine]).ravel()


def test_the_estimate_is_the_posterior_mean():
    """By dense matrices of all readings, the zero free."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    fleet = ta.fleet(units(rng), orders=range(1, 5))
    prior = fleet.prior
    run = few(rng, MEAN, 12)
    fit = ta.fit(run, prior=fleet, loss="linear")
    turn = np.radians(run.reference)
    columns = np.column_stack([f(k * turn) for k in range(1, 5) for f in (np.cos, np.sin)])
    columns = np.column_stack([np.ones(turn.size), columns])
    precision = np.diag(np.concatenate([[0.0], 1.0 / prior.variance]))
    hessian = columns.T @ columns / prior.noise_variance + precision
    target = columns.T @ run.centred_error / prior.noise_variance
    target[1:] += prior.mean / prior.variance
    assert known(fit) == pytest.approx(np.linalg.solve(hessian, target)[1:], abs=1e-12)
    assert fit.covariance[1:, 1:] == pytest.approx(np.linalg.inv(hessian)[1:, 1:], rel=1e-8)
    assert fit.covariance[0, 0] == pytest.approx(np.linalg.inv(hessian)[0, 0], rel=1e-8)


def test_with_many_readings_it_is_the_plain_fit():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    fleet = ta.fleet(units(rng), orders=range(1, 5))
    free = replace(fleet.prior, variance=np.full(8, 1e6))
    run = few(rng, MEAN, 400)
    plain = ta.fit(run, orders=range(1, 5), loss="linear", covariance="white")
    fit = ta.fit(run, prior=free, loss="linear")
    assert known(fit) == pytest.approx(known(plain), abs=1e-12)
    assert fit.model.constant == pytest.approx(plain.model.constant, abs=1e-12)
    assert fit.residual_std == pytest.approx(plain.residual_std, rel=1e-9)
    assert fit.posterior.share == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("tail", [None, 5])
def test_intervals_hold_as_often_as_they_say(tail):
    """Over units of the model, and of Student's t of 5 degrees of freedom."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    held = []
    for _ in range(12):
        fleet = ta.fleet(units(rng, 40, tail=tail, runs=1), orders=range(1, 5))
        for _ in range(15):
            own = rng.normal(0.0, 10.0, (4, 2))
            if tail is not None:
                own /= np.sqrt(rng.chisquare(tail, (4, 1)) / (tail - 2.0))
            fit = ta.fit(few(rng, own + MEAN, 12), prior=fleet)
            low, high = fit.interval()[1:].T
            truth = ARCSEC * (own + MEAN).ravel()
            held.append((low < truth) & (truth < high))
    print("held", np.mean(held))
    assert 0.93 <= np.mean(held) <= 0.975


def test_it_says_how_much_is_the_units_own():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 3)
    fleet = ta.fleet(units(rng), orders=range(1, 5))
    shares = [ta.fit(few(rng, MEAN, n), prior=fleet).posterior.share for n in (4, 10, 100)]
    assert shares[0] < shares[1] < shares[2] < 1.0
    fit = ta.fit(few(rng, MEAN, 10), prior=fleet)
    assert any("the unit's own" in note for note in fit.notes)
    assert fit.to_dict()["prior"]["units"] == 40
    assert "prior" in fit.to_dict()["intervals_hold"]


def test_an_outlier_among_ten_readings_is_set_aside():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 4)
    fleet = ta.fleet(units(rng), orders=range(1, 5))
    run = few(rng, MEAN, 24)
    indicated = run.indicated.copy()
    indicated[4] += 1.0
    bad = ta.CalibrationRun(run.reference, indicated, 360.0)
    assert ta.fit(bad, prior=fleet).wild == (("1", 4),)


def test_what_does_not_go_with_a_prior_is_refused():
    rng = np.random.default_rng(SEED)
    fleet = ta.fleet(units(rng, 6), orders=[1, 2])
    run = few(rng, MEAN, 12)
    with pytest.raises(KindError, match="prior must be"):
        ta.fit(run, prior={})
    with pytest.raises(ArgumentError, match="nuisance does not go with `prior="):
        ta.fit(run, prior=fleet, nuisance="auto")
    with pytest.raises(ArgumentError, match="loss must be"):
        ta.fit(run, prior=fleet, loss="huber")
    turns = ta.CalibrationRun(run.reference / 360.0, run.indicated / 360.0, 1.0)
    with pytest.raises(ArgumentError, match="prior is in deg"):
        ta.fit(turns, prior=fleet)


@pytest.mark.slow
def test_measured_motors_from_ten_readings(data_dir):
    """Leave one motor out; five of the fifteen units are one motor."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 5)
    measured = data_dir / "stepper_encoder_units.csv"
    one = {"unit_07", "unit_08", "unit_09", "unit_11", "unit_12"}
    runs = [replace(r, unit="one" if r.label in one else r.label) for r in ta.read_runs(measured)]
    motors = list(dict.fromkeys(r.unit for r in runs))
    wanted = {10: 0.068, 16: 0.046, 24: 0.037, 40: 0.034}
    left = {count: [] for count in wanted}
    for motor in motors:
        fleet = ta.fleet([r for r in runs if r.unit != motor])
        own = [r for r in runs if r.unit == motor]
        for count, medians in left.items():
            found = []
            for draw in range(40):
                run = own[draw % len(own)]
                rows = np.sort(rng.choice(len(run), count, replace=False))
                part = ta.CalibrationRun(run.reference[rows], run.indicated[rows], 360.0)
                fit = ta.fit(part, prior=fleet, loss="linear")
                others = np.setdiff1d(np.arange(len(run)), rows)
                error = run.indicated[others] - run.reference[others]
                rest = ta.wrap(error - fit.model.error(run.reference[others]), 360.0)
                found.append(np.sqrt(np.mean(rest**2)))
            medians.append(np.median(found))
    medians = {count: float(np.median(found)) for count, found in left.items()}
    print(medians)
    for count, figure in wanted.items():
        assert medians[count] <= 1.05 * figure
