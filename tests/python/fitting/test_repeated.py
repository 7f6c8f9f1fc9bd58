"""What orders left out put into a fit at positions that are read again and again."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting import repeated
from trueangle.fitting.uncertainty import Uncertainty, coefficient_uncertainty

ARCSEC = 3600.0

#: Fits of a design, and how far the root mean square of their 2 x 100 pulls may be from 1: the
#: two of a fit are one number in the worst case, sqrt(1 / (2 x 100)) = 0.07 and twice that.
FITS, AWAY = 100, 0.15


def read(rng, places, runs, noise, error, order=1):
    """Runs in degrees: a line of 40 arcsec, the same error at each place, noise, own zeros."""
    line = 40.0 * np.cos(order * np.radians(places) - 0.3) + error
    return [
        ta.CalibrationRun(
            places,
            places + (line + noise * rng.normal(size=places.size) + 3.0 * rng.normal()) / ARCSEC,
            period=360.0,
        )
        for _ in range(runs)
    ]


def left_out(rng, places, size, orders):
    """Orders of equal strength, ``size`` rms together."""
    each = size / math.sqrt(len(orders))
    angle = np.radians(places)[:, None] * np.asarray(orders)
    a, b = rng.normal(0.0, each, (2, len(orders)))
    return np.cos(angle) @ a + np.sin(angle) @ b


def pulls(places, runs, size, orders, covariance="auto", free=False, fits=FITS):
    """Errors of the line's coefficients over their standard errors."""
    found = []
    for seed in range(fits):
        rng = np.random.default_rng([71, runs, seed])
        at = np.sort(rng.uniform(0.0, 360.0, places.size)) if free else places
        taken = read(rng, at, runs, 0.5, left_out(rng, at, size, orders))
        fit = ta.fit(taken, orders=[1], covariance=covariance)
        shaft = fit.model.shafts[0]
        away = [shaft.cosine[0] - 40.0 * math.cos(0.3) / ARCSEC]
        away += [shaft.sine[0] - 40.0 * math.sin(0.3) / ARCSEC]
        found.append(np.array(away) / np.sqrt(np.diag(fit.covariance))[1:])
    return np.array(found)


@pytest.mark.parametrize(
    ("count", "step", "runs", "size", "covariance"),
    [
        (20, 10.0, 6, 5.0, "auto"),
        (20, 10.0, 12, 5.0, "auto"),
        (27, 10.0, 4, 2.0, "cluster"),
        (33, 10.0, 10, 3.0, "auto"),
        (50, 5.0, 5, 1.0, "auto"),
    ],
)
def test_errors_hold_over_part_of_a_grid(count, step, runs, size, covariance):
    """Twelve runs of 20 places: the scatter between them alone was off by 10 standard errors."""
    every = range(2, round(180.0 / step))
    z = pulls(step * np.arange(count), runs, size, every, covariance)
    assert abs(math.sqrt(np.mean(z**2)) - 1.0) < AWAY, z.std(axis=0)
    assert abs(z.mean()) < 0.25


@pytest.mark.parametrize("runs", [4, 12])
def test_errors_hold_at_places_of_no_grid(runs):
    z = pulls(np.zeros(40), runs, 4.0, range(2, 200), free=True, fits=2 * FITS)
    assert abs(math.sqrt(np.mean(z**2)) - 1.0) < AWAY


def test_a_closing_reading_leaks_too():
    """One place of a whole grid read twice in a run: what it errs by counts double."""
    places = np.append(10.0 * np.arange(36), 360.0)
    z = pulls(places, 10, 4.0, range(2, 18), "cluster")
    assert abs(math.sqrt(np.mean(z**2)) - 1.0) < AWAY


def shape(fit):
    """What stands beside the covariance of noise."""
    problem = fit.problem
    alone = coefficient_uncertainty(problem, fit.fitted, problem.base, fit.ridge, "auto")
    return fit.covariance - alone.covariance


def test_it_is_the_covariance_of_fits_to_each_order_left_out():
    """The slow reference: fits of pure patterns, one order after another, without any noise."""
    rng = np.random.default_rng(5)
    places = 10.0 * np.arange(22)
    runs = read(rng, places, 9, 0.3, left_out(rng, places, 4.0, range(2, 18)))
    fit = ta.fit(runs, orders=[1, 3])
    expected = np.zeros((5, 5))
    for order in (2, *range(4, 19)):
        for pattern in (np.cos, np.sin):
            if order == 18 and pattern is np.sin:
                continue
            error = 1e-3 * pattern(order * np.radians(places))
            one = ta.fit(ta.CalibrationRun(places, places + error, period=360.0), orders=[1, 3])
            solution = one.fitted.solution
            pairs = zip(solution.cosine[0], solution.sine[0], strict=True)
            found = np.array([solution.constant, *np.ravel([*pairs])]) / 1e-3
            expected += (1.0 if order == 18 else 2.0) / 36.0 * np.outer(found, found)
    added = shape(fit)
    size = np.trace(added[1:, 1:]) / np.trace(expected[1:, 1:])
    np.testing.assert_allclose(added, size * expected, atol=2e-3 * np.abs(added).max())
    assert 2.0 < math.sqrt(size) * ARCSEC < 7.0


def test_orders_left_out_of_a_whole_grid_do_not_leak():
    rng = np.random.default_rng(6)
    places = 10.0 * np.arange(36)
    runs = read(rng, places, 9, 0.3, left_out(rng, places, 4.0, range(2, 18)))
    fit = ta.fit(runs, orders=[1])
    assert np.abs(shape(fit)).max() < 1e-6 * fit.covariance.max()
    assert not any("omitted orders repeat" in note for note in fit.notes)


@pytest.mark.parametrize("why", ["clean", "white", "once", "other places"])
def test_nothing_is_added_where_nothing_is_known_to_repeat(why):
    rng = np.random.default_rng(7)
    places = 10.0 * np.arange(22)
    error = left_out(rng, places, 4.0, range(2, 18))
    if why == "clean":
        runs = read(rng, places, 6, 0.3, 0.0)
    elif why == "other places":
        # Each run at places of its own: the scatter between runs holds what leaks.
        own = [np.sort(rng.uniform(0.0, 360.0, 30)) for _ in range(9)]
        runs = [read(rng, at, 1, 0.3, 4.0 * np.cos(7.0 * np.radians(at)))[0] for at in own]
    else:
        runs = read(rng, places, 1 if why == "once" else 6, 0.3, error)
    asked = "white" if why == "white" else "auto"
    fit = ta.fit(runs, orders=[1], covariance=asked)
    alone = coefficient_uncertainty(fit.problem, fit.fitted, fit.problem.base, fit.ridge, asked)
    np.testing.assert_array_equal(fit.covariance, alone.covariance)


@pytest.mark.parametrize("covariance", ["auto", "white"])
def test_what_repeats_is_not_summed_where_nothing_could_be_added(covariance, monkeypatch):
    rng = np.random.default_rng(29)
    places = np.arange(1200) * 0.3 if covariance == "auto" else np.arange(40) * 4.0
    fit = ta.fit(read(rng, places, 2, 0.3, 0.0), orders=[1], covariance=covariance)
    monkeypatch.setattr(repeated, "_repeats", None)
    assert fit.covariance.shape == (3, 3)


def test_it_is_said_with_how_much_wider_they_are():
    rng = np.random.default_rng(8)
    places = 10.0 * np.arange(20)
    fit = ta.fit(read(rng, places, 10, 0.3, left_out(rng, places, 4.0, range(2, 18))), orders=[1])
    alone = coefficient_uncertainty(fit.problem, fit.fitted, fit.problem.base, 0.0, "auto")
    sums = [np.trace(matrix[1:, 1:]) for matrix in (fit.covariance, alone.covariance)]
    times = f"{math.sqrt(sums[0] / sums[1]):.2g} times those of noise"
    assert sum("mitted orders repeat at every position" in note for note in fit.notes) == 1
    assert any(times in note for note in fit.notes)
    # The 20 places, less the line and the zero, tell how strong they are: 17, and a little noise.
    freedom = fit.uncertainty.freedom[1:]
    assert 17.0 <= freedom.min() <= freedom.max() < 30.0


def test_a_reading_set_aside_does_not_make_its_place_repeat():
    """One wild reading of 60 at a place: neither its noise nor an order left out."""
    rng = np.random.default_rng(9)
    places = 10.0 * np.arange(20)
    runs = read(rng, places, 6, 0.3, left_out(rng, places, 4.0, range(2, 18)))
    sound = ta.fit(runs, orders=[1])
    wild = runs[2].indicated.copy()
    wild[7] += 0.5
    runs[2] = ta.CalibrationRun(places, wild, period=360.0)
    fit = ta.fit(runs, orders=[1])
    assert len(fit.wild) == 1
    ratio = np.sqrt(np.diag(fit.covariance) / np.diag(sound.covariance))
    assert (abs(ratio - 1.0) < 0.25).all()


@pytest.mark.parametrize("unit", [1.0, 2.0 * math.pi, 65536.0])
def test_the_unit_and_the_order_of_runs_do_not_matter(unit):
    rng = np.random.default_rng(10)
    places = 10.0 * np.arange(25)
    runs = read(rng, places, 5, 0.3, left_out(rng, places, 4.0, range(2, 18)))
    scale = unit / 360.0
    other = [ta.CalibrationRun(r.reference * scale, r.indicated * scale, unit) for r in runs[::-1]]
    one, same = ta.fit(runs, orders=[1, 2]), ta.fit(other, orders=[1, 2])
    wide = one.covariance * scale**2
    np.testing.assert_allclose(same.covariance, wide, rtol=1e-7, atol=1e-9 * wide.max())


def test_freedom_beside_a_bias_is_welch_and_satterthwaites():
    """Between those of the two variances, weighted by their squares; of a known bias by noise's."""
    noise = Uncertainty("cluster", np.diag([1.0, 4.0]), np.array([10.0, 10.0]))
    both = noise.beside(np.diag([3.0, 0.0]), 5.0)
    assert both.freedom[0] == pytest.approx(16.0 / (1.0 / 10.0 + 9.0 / 5.0))
    assert both.freedom[1] == pytest.approx(10.0)
    assert noise.beside(np.diag([3.0, 4.0])).freedom == pytest.approx([160.0, 40.0])
    assert both.fewest == 10.0
