"""What a fleet says of its units and of a further one, from the runs by least squares."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.fleets.calibration import Calibration, CalibrationSums, order_columns
from trueangle.fleets.history import changes_of, drift_bound, next_calibration
from trueangle.support.distributions import f_quantile, normal_quantile

from .made import MEAN, alone, pattern, units

SEED = 52_400
ORDERS = np.arange(1.0, 5.0)
ARCSEC = 3600.0


def solved(runs, period=360.0):
    """By numpy: coefficients, covariance for unit variance, zeros of runs, squares left."""
    design, error = [], []
    for i, run in enumerate(runs):
        zero = np.zeros((len(run), len(runs)))
        zero[:, i] = 1.0
        design.append(np.hstack([order_columns(run.reference, ORDERS, period), zero]))
        error.append(run.centred_error)
    design, error = np.vstack(design), np.concatenate(error)
    found = np.linalg.lstsq(design, error, None)[0]
    left = error - design @ found
    return found, np.linalg.inv(design.T @ design), float(left @ left)


@pytest.fixture(scope="module")
def fleet_of():
    print("seed", SEED)
    runs = units(np.random.default_rng(SEED), 16, runs=3)
    return runs, ta.fleet(runs, orders=ORDERS)


@pytest.mark.parametrize("sizes", [(40,), (40, 25), (60, 17, 31)])
def test_a_calibration_is_the_least_squares_of_all_its_runs(sizes):
    """Part of a turn and unlike runs, so that zeros and orders hang together."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, *sizes])
    runs, sums = [], CalibrationSums()
    for n in sizes:
        x = np.sort(rng.uniform(0.0, 250.0, n))
        error = pattern(MEAN, x) + (rng.normal(0.0, 3.0, n) + rng.normal(0.0, 5.0)) / ARCSEC
        runs.append(ta.CalibrationRun(x, x + error, 360.0))
        sums.add(runs[-1], ORDERS, periodic=True)
    made = Calibration.of("u", sums, 360.0)
    found, inverse, squares = solved(runs)
    np.testing.assert_allclose(made.coefficients, found[:8], atol=1e-9)
    np.testing.assert_allclose(made.inverse, inverse[:8, :8], rtol=1e-6, atol=1e-9)
    mean = np.r_[np.zeros(8), np.full(len(sizes), 1.0 / len(sizes))]
    assert made.zero == pytest.approx(found[8:].mean(), abs=1e-9)
    assert made.zero_inverse == pytest.approx(mean @ inverse @ mean, rel=1e-6)
    assert made.squares == pytest.approx(squares, rel=1e-6)
    assert made.freedom == sum(sizes) - 8 - len(sizes)
    assert made.repeat_freedom == 2.0 * (len(sizes) - 1)
    # About patterns of single runs, where there are several.
    within = sum(solved([run])[2] for run in runs) if len(sizes) > 1 else 0.0
    assert made.within_squares == pytest.approx(within, rel=1e-6)
    assert made.within_freedom == (sum(n - 9 for n in sizes) if len(sizes) > 1 else 0)


def test_a_units_amplitudes_phases_and_errors_are_those_of_its_readings(fleet_of):
    runs, fleet = fleet_of
    noise = sum(solved(runs[3 * u : 3 * u + 3])[2] for u in range(16)) / (16 * (540 - 11))
    for unit in fleet.units:
        found, inverse, squares = solved([run for run in runs if run.unit == unit.unit])
        for k, row in enumerate(unit.orders):
            a, b = found[2 * k : 2 * k + 2]
            assert row.amplitude == pytest.approx(np.hypot(a, b), rel=1e-9)
            # C sin(k x + phase): the cosine is C sin(phase).
            assert row.amplitude * np.sin(np.radians(row.phase_deg)) == pytest.approx(a, abs=1e-9)
            assert row.amplitude * np.cos(np.radians(row.phase_deg)) == pytest.approx(b, abs=1e-9)
            own = noise * (inverse[2 * k, 2 * k] + inverse[2 * k + 1, 2 * k + 1]) / 2.0
            assert row.std == pytest.approx(np.sqrt(own), rel=1e-9)
        assert unit.left == pytest.approx(np.sqrt(squares / (540 - 11)), rel=1e-9)


def test_the_common_pattern_and_the_prior_are_those_of_balanced_units(fleet_of):
    """Mean of n units: its error is that between all over n; a further unit scatters by both."""
    runs, fleet = fleet_of
    assert all(unit.verdict == "fine" for unit in fleet.units)
    values = np.array([solved(runs[3 * u : 3 * u + 3])[0][:8] for u in range(16)])
    scatter = ((values - values.mean(axis=0)) ** 2).reshape(16, 4, 2).sum(axis=(0, 2)) / 30.0
    noise = fleet.prior.noise_variance * 2.0 / 540.0
    for k, (common, between) in enumerate(zip(fleet.common, fleet.between, strict=True)):
        assert common.cosine == pytest.approx(values[:, 2 * k].mean(), rel=1e-6)
        assert common.std == pytest.approx(np.sqrt(scatter[k] / 16.0), rel=1e-6)
        assert between.std == pytest.approx(np.sqrt(scatter[k] - noise), rel=1e-6)
    prior = fleet.prior
    assert prior.variance == pytest.approx(np.repeat(scatter - noise + scatter / 16.0, 2), rel=1e-6)
    assert (prior.freedom, prior.units) == (30.0, 16)
    # Of single runs about the coefficients of all three: 2 (3 - 1) degrees of freedom a unit.
    apart = [solved([run])[0][:8] - values[i // 3] for i, run in enumerate(runs)]
    squares = (np.array(apart) ** 2).reshape(48, 4, 2).sum(axis=(0, 2)) / (4.0 * 16.0)
    repeats = [between.repeatability for between in fleet.between]
    assert repeats == pytest.approx(np.sqrt(squares), rel=1e-6)


def test_what_does_not_share_a_mean_has_two_degrees_of_freedom_more():
    print("seed", SEED)
    found = ta.fleet(units(np.random.default_rng(SEED + 1), 16, aligned=False), orders=[1, 2])
    assert (found.aligned, found.prior.freedom) == (False, 2.0 * found.prior.units)


def test_the_statistic_of_a_date_is_its_distance_in_the_noise_of_both():
    """T^2 with unlike dates: one run of the first, three of the last."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    runs = units(rng, 10, dates=("2026-01-10", "2026-07-10"), spread=2.0)
    runs = [r for r in runs if r.when.startswith("2026-07") or r.label == "r0"]
    fleet = ta.fleet(runs, orders=ORDERS)
    n = 10
    assert fleet.history[0].limit == pytest.approx(
        2.0 * f_quantile(1.0 - 0.005 / (4 * n), 2.0, 2.0 * (n - 1.0))
    )
    noise = fleet.prior.noise_variance
    changes, own, lasts = [], [], []
    for u in range(n):
        of_unit = [r for r in runs if r.unit == f"u{u}"]
        first, last = (solved([r for r in of_unit if r.when == w])
                       for w in ("2026-01-10", "2026-07-10"))  # fmt: skip
        changes.append(last[0][:8] - first[0][:8])
        lasts.append(last[0][:8])
        own.append(noise * (np.diag(last[1])[:8] + np.diag(first[1])[:8]))
    changes, own = np.array(changes).reshape(n, 4, 2), np.array(own).reshape(n, 4, 2)
    rows = {row.unit: row for row in fleet.history}
    # Units are compared by their last date, three runs of 180 readings.
    assert all(unit.verdict == "fine" for unit in fleet.units)
    scatter = np.var(lasts, axis=0, ddof=1).reshape(4, 2).mean(axis=1)
    between = np.array([row.std for row in fleet.between])
    assert between**2 == pytest.approx(scatter - 2.0 * noise / 540.0, rel=1e-6)
    for k in range(4):
        # The variance of an ordinary change is the same in all units: two of them tell it.
        squares = (changes[:, k] ** 2).sum(axis=1)
        ordinary = max(np.median(squares) / (2.0 * np.log(2.0)) - own[:, k].mean(), 0.0)
        for u in range(n):
            wanted = squares[u] / (ordinary + own[u, k].mean())
            assert rows[f"u{u}"].orders[k].statistic == pytest.approx(wanted, rel=0.02)


def test_a_zero_that_moved_has_its_own_limit_and_statistic():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 3)
    runs = units(
        rng, 12, dates=("2026-01-10", "2026-07-10"),
        change=lambda u, t, b: (b, 400.0 * (u == 5 and t)),
    )  # fmt: skip
    fleet = ta.fleet(runs, orders=[1, 2])
    (row,) = [row for row in fleet.history if row.verdict == "zero_moved"]
    assert (row.unit, row.order) == ("u5", None)
    assert row.limit == pytest.approx(f_quantile(1.0 - 0.005 / 12.0, 1.0, 10.0))
    assert row.statistic > row.limit
    (unit,) = [unit for unit in fleet.units if unit.unit == "u5"]
    told = float(unit.because.split("moved by ")[1].split()[0])
    # 400 arcsec beside an ordinary remounting of 5 arcsec on either date.
    assert abs(told - 400.0) < 4.5 * np.hypot(5.0, 5.0)


def blank(when=None):
    """A calibration of one order, known well."""
    return alone(1e-6, 1e-6, when)


def test_a_leap_is_farther_than_two_units_are_apart_in_99_percent_of_fleets():
    """Of two units with a variance of 25 the square apart is 50 chi-squared of two."""
    rng = np.random.default_rng(SEED + 4)
    small = rng.normal(0.0, 0.01, (8, 2))
    for times, leaps in ((1.03, True), (0.97, False)):
        far = np.sqrt(times * 100.0 * np.log(8.0 / 0.01))
        dated = []
        for u in range(8):
            last = small[u] + (np.array([0.6, -0.8]) * far if u == 3 else 0.0)
            pair = (blank("2026-01-10"), replace(blank("2026-07-10"), coefficients=last))
            dated.append([(replace(one, unit=f"u{u}"), 1.0) for one in pair])
        found = changes_of(dated, np.array([1.0]), 360.0, np.array([25.0]), None)
        assert [one.moved for one in found] == [u == 3 for u in range(8)]
        assert found[3].leaps is leaps


@pytest.mark.parametrize(("unsure", "moved"), [(None, True), (0, False), (1, False)])
def test_a_zero_has_not_moved_by_more_than_either_date_knows_it(unsure, moved):
    """A zero that is off by 1 degree, on one date known to no better than that."""
    dated = []
    for u in range(8):
        pair = [blank("2026-01-10"), replace(blank("2026-07-10"), zero=1e-3 * u + (u == 3))]
        if u == 3 and unsure is not None:
            pair[unsure] = replace(pair[unsure], zero_inverse=1.0)
        dated.append([(replace(one, unit=f"u{u}"), 1.0) for one in pair])
    found = changes_of(dated, np.array([1.0]), 360.0, np.array([25.0]), None)
    assert [one.zero_moved for one in found] == [moved and u == 3 for u in range(8)]


@pytest.mark.parametrize("period", [360.0, 1.0, 2.0 * np.pi])
def test_the_bound_of_a_drift_is_95_percent_one_sided_at_the_worst_place(period):
    change, std = np.array([3.0, -4.0, 0.0, 2.0]), np.array([0.5, 0.2, 0.1, 0.3])
    x = np.radians(np.arange(360.0))
    columns = np.column_stack([np.cos(x), np.sin(x), np.cos(3.0 * x), np.sin(3.0 * x)])
    wanted = np.abs(columns @ change) + normal_quantile(0.95) * np.sqrt(columns**2 @ std**2)
    found = drift_bound(change, std, np.array([1.0, 3.0]), period)
    assert found == pytest.approx(wanted.max(), rel=1e-6)


def test_the_next_date_is_that_of_a_straight_line_and_is_extrapolated_beyond_twice_the_time():
    dated = [(blank(when), 1.0) for when in ("2026-01-01", "2026-04-11")]
    for times, due, extrapolated in (
        (0.5, "2026-04-11", False),  # 100 days passed; permitted after 50: now
        (1.5, "2026-05-31", False),
        (1.99, "2026-07-19", False),
        (2.5, "2026-09-08", True),
    ):
        assert next_calibration(2.0, dated, 2.0 * times) == (due, extrapolated)
    assert next_calibration(0.0, dated, 1.0) == (None, False)
    assert next_calibration(1.0, dated, None) == (None, False)


def test_units_of_one_unit_of_angle_are_those_of_another(fleet_of):
    """Degrees against turns: every angle of the fleet over its turn."""
    runs, fleet = fleet_of
    turns = [
        ta.CalibrationRun(r.reference / 360.0, r.indicated / 360.0, 1.0, unit=r.unit, label=r.label)
        for r in runs
    ]
    other = ta.fleet(turns, orders=ORDERS).to_dict()

    def numbers(value):
        if isinstance(value, dict):
            return [x for key in sorted(value) for x in numbers(value[key])]
        if isinstance(value, list | tuple):
            return [x for one in value for x in numbers(one)]
        return [float(value)] if isinstance(value, int | float) else []

    np.testing.assert_allclose(numbers(other), numbers(fleet.to_dict()), rtol=1e-6, atol=1e-9)


def test_mirrored_units_have_mirrored_orders_and_the_order_of_runs_does_not_matter(fleet_of):
    runs, fleet = fleet_of
    mirrored = ta.fleet(
        [ta.CalibrationRun(-r.reference, -r.indicated, 360.0, unit=r.unit, label=r.label)
         for r in reversed(runs)],
        orders=ORDERS,
    )  # fmt: skip
    for a, b in zip(fleet.common, mirrored.common, strict=True):
        assert (b.cosine, b.sine) == pytest.approx((-a.cosine, a.sine), abs=1e-9)
        assert b.std == pytest.approx(a.std, rel=1e-6)
    by_name = {unit.unit: unit for unit in mirrored.units}
    for unit in fleet.units:
        assert by_name[unit.unit].p == pytest.approx(unit.p, rel=1e-6)
        assert by_name[unit.unit].peak_to_peak == pytest.approx(unit.peak_to_peak, rel=1e-6)
