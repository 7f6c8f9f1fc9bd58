"""What a budget takes from the readings, against loops written out; values in every unit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.certificate import Budget, Contribution, Identity, Specification, certify, conformity
from trueangle.certificate.values import (
    corrected_runs,
    is_of_these,
    left_at_places,
    reversal_halfwidth,
)
from trueangle.model.records import Provenance
from trueangle.support.files import InputFile

SEED = 61_000
UNITS = (360.0, 1.0, 2.0 * np.pi)
ARCSEC = 1_296_000.0


def fit_of(parts, ways, period=360.0, places=None, weights=None):
    """What these functions read of a fit: residuals of runs in arcsec, and how they moved."""
    runs = []
    for number, (rest, way) in enumerate(zip(parts, ways, strict=True)):
        angle = np.linspace(0.0, 0.9, rest.size) if places is None else places[number]
        x = period * np.asarray(angle)
        runs.append(ta.CalibrationRun(x, x, period, velocity=np.asarray(way, float)))
    residuals = np.concatenate(parts) * (period / ARCSEC)
    model = SimpleNamespace(period=period, shafts=())
    return SimpleNamespace(
        model=model, runs=runs, residuals=residuals, weights=weights, nuisance=None
    )


@pytest.mark.parametrize("period", UNITS)
def test_half_a_reversal_error_counts_from_three_standard_errors_of_the_runs_on(period):
    """Halves m - 1, m, m + 1: a standard error of 1/sqrt 3, and (m/u)²/2 degrees of freedom."""
    way = np.tile([1.0, -1.0], 6)
    for mean, seen in ((1.02 * np.sqrt(3.0), True), (0.98 * np.sqrt(3.0), False)):
        parts = [(mean + d) * way for d in (-1.0, 0.0, 1.0)]
        found = reversal_halfwidth(fit_of(parts, 3 * [way], period))
        assert found.standard == pytest.approx(mean if seen else 0.0, rel=1e-9)
        assert found.degrees_of_freedom == pytest.approx(1.5 * mean**2 if seen else np.inf)
        assert (found.kind, found.distribution) == ("A", "two-point")


@pytest.mark.parametrize("runs", [1, 2])
def test_of_one_or_two_runs_it_is_the_scatter_of_their_readings(runs):
    """Twelve readings, two unknowns: a variance of S / 10, and of the half of S / 120."""
    way = np.tile([1.0, -1.0], 6)
    rest = np.repeat([1.0, -1.0, 2.0, -2.0, 0.5, -0.5], 2)  # of no mean, either way alike
    error = np.sqrt(rest @ rest / 10.0 / 12.0)
    for times, seen in ((3.02, True), (2.98, False)):
        parts = [times * error * way + rest * (1.0 if k == 0 else 0.5) for k in range(runs)]
        found = reversal_halfwidth(fit_of(parts, runs * [way]))
        assert found.standard == pytest.approx(times * error if seen else 0.0, rel=1e-9)
        assert found.degrees_of_freedom == pytest.approx(0.5 * times**2 if seen else np.inf)
    assert reversal_halfwidth(fit_of([rest], [np.ones(12)])) is None


def by_loops(parts, places, kept):
    """Mean over the places of the mean product of two runs' means there; places; chance of F."""
    means = {}
    for run, (rest, turn, keep) in enumerate(zip(parts, places, kept, strict=True)):
        for value, place in zip(rest[keep], np.floor(360.0 * turn[keep]).astype(int), strict=True):
            means.setdefault(place, {}).setdefault(run, []).append(value)
    products, between, within, again = [], 0.0, 0.0, 1 - len(parts)
    for of_runs in means.values():
        m = [np.mean(values) for values in of_runs.values()]
        pairs = [a * b for i, a in enumerate(m) for j, b in enumerate(m) if i != j]
        if pairs:
            products.append(np.mean(pairs))
            between += len(m) * np.mean(m) ** 2
            within += sum((a - np.mean(m)) ** 2 for a in m)
            again += len(m) - 1
    freedom = len(products) - 1
    chance = stats.f.sf(between / freedom / (within / again), freedom, again)
    return np.mean(products), len(products), chance


@pytest.mark.parametrize("period", UNITS)
def test_what_places_keep_is_the_mean_product_of_runs_there(period):
    """Against loops: 200 draws of unlike sizes, some seen and some not."""
    print("seed", SEED)
    seen = 0
    for draw in range(200):
        rng = np.random.default_rng([SEED, draw])
        kept_there = rng.normal(0.0, rng.choice([0.2, 0.6, 2.0]), 24)
        places, parts, kept = [], [], []
        for _ in range(int(rng.integers(2, 5))):
            at = rng.integers(0, 24, 40)
            places.append((15.0 * at + rng.uniform(0.1, 0.9, 40)) / 360.0)
            parts.append(kept_there[at] + rng.normal(0.0, 1.0, 40))
            kept.append(rng.random(40) < 0.9)
        weights = [keep.astype(float) for keep in kept]
        fit = fit_of(parts, [np.ones(40)] * len(parts), period, places, weights)
        found = left_at_places(fit)
        variance, count, chance = by_loops(parts, places, kept)
        is_seen = chance < 1.0 - 0.9545
        seen += is_seen
        wanted = np.sqrt(max(variance, 0.0)) if is_seen else 0.0
        assert found.standard == pytest.approx(wanted, rel=1e-9), draw
        assert found.degrees_of_freedom == count
    assert 40 < seen < 160


@pytest.mark.parametrize(
    ("count", "runs", "size"), [(9, 4, 3.0), (10, 2, 6.0), (14, 5, 2.0), (30, 3, 1.0)]
)
def test_of_few_places_it_is_seen_as_well(count, runs, size):
    """Of twelve places what each errs by had never been three of its standard errors."""
    print("seed", SEED + count)
    places = 360.0 / count * np.arange(count)
    inside, wide = [], []
    for draw in range(40):
        rng = np.random.default_rng([SEED + count, draw])
        error = 20.0 * np.cos(np.radians(places)) + size * rng.normal(size=count)
        taken = [
            ta.CalibrationRun(
                places, places + (error + 0.4 * rng.normal(size=count) + zero) / 3600.0, 360.0
            )
            for zero in rng.normal(0.0, 5.0, runs)
        ]
        rows = certify(taken, Identity("1", "joint"), orders=[1]).content["positions"]
        off = [row["error_arcsec"] for row in rows] - (error - error.mean())
        inside += [abs(e) <= row["expanded_arcsec"] for e, row in zip(off, rows, strict=True)]
        wide.append(rows[0]["expanded_arcsec"] / np.sqrt(np.mean(off**2)))
    # Few places have no tails: not one of nine is beyond three times their root mean square.
    assert np.mean(inside) > 0.93
    assert 1.8 < np.median(wide) < 3.5


@pytest.mark.parametrize("runs", [2, 6])
def test_of_noise_alone_it_is_seen_as_seldom_as_the_level_says(runs):
    """Once in 22, of 300 certificates 14 with a standard deviation of 3.6."""
    print("seed", SEED + runs)
    places = 24.0 * np.arange(15)
    seen = 0
    for draw in range(300):
        rng = np.random.default_rng([SEED, runs, draw])
        taken = [
            ta.CalibrationRun(places, places + rng.normal(size=15) / 3600.0, 360.0)
            for _ in range(runs)
        ]
        fit = ta.fit(taken, orders=[1, 2], covariance="white")
        seen += left_at_places(fit).standard > 0.0
    assert 3 <= seen <= 27


def test_one_run_alone_cannot_show_it():
    parts = [np.repeat([1.0, -1.0], 10)]
    assert left_at_places(fit_of(parts, [np.ones(20)])).standard == 0.0


def test_the_least_chance_and_the_worst_positions_own_limit_are_told():
    rows = [
        {
            "angle_deg": 10.0 * k, "error_arcsec": e, "standard_arcsec": u,
            "degrees_of_freedom": free, "expanded_arcsec": 2.0 * u,
        }
        for k, (e, u, free) in enumerate([(1.0, 0.5, None), (7.0, 1.0, 3.0), (2.0, 1.5, None)])
    ]  # fmt: skip
    found = conformity(Specification(10.0, "guard_band"), rows)
    assert found["worst"]["angle_deg"] == 10.0
    assert found["worst"]["acceptance_limit_arcsec"] == 8.0
    from scipy.stats import t

    # The second: three standard uncertainties from the limit, with three degrees of freedom.
    assert found["conformance_probability"] == pytest.approx(t.cdf(3.0, 3) - t.cdf(-17.0, 3))
    assert found["counts"] == {
        "pass": 3, "conditional_pass": 0, "conditional_fail": 0, "fail": 0,
    }  # fmt: skip


def test_degrees_of_freedom_are_cut_to_whole_ones():
    from scipy.stats import t

    two = Budget((Contribution("a", 1.0, "A", "t", 5.0), Contribution("b", 0.9, "A", "t", 7.0)))
    free = 1.81**2 / (1.0 / 5.0 + 0.81**2 / 7.0)
    assert two.degrees_of_freedom == pytest.approx(free)
    assert two.expanded == pytest.approx(t.ppf(0.97725, np.floor(free)) * np.sqrt(1.81))


@pytest.mark.parametrize("runs_in", UNITS)
@pytest.mark.parametrize("model_in", UNITS)
def test_readings_as_left_are_the_same_in_every_unit(runs_in, model_in):
    """A pattern, a delay and play, corrected in the model's unit and in the readings'."""
    t = np.linspace(0.0, 10.0, 200)
    turns = 0.4 - 0.4 * np.cos(0.6 * t)

    def left(readings, unit):
        shaft = ta.Shaft("output", 1, [1, 3], [2e-4 * unit, 0.0], [0.0, 1e-4 * unit])
        terms = (ta.terms.Latency(0.01), ta.terms.Backlash(2e-5 * unit))
        model = ta.HarmonicModel([shaft], period=unit, terms=terms)
        run = ta.CalibrationRun(readings * turns, readings * (turns + 1e-3), readings, time=t)
        (corrected,) = corrected_runs(model, [run])
        return (corrected.indicated - run.indicated) / readings

    same = left(360.0, 360.0)
    assert np.ptp(same) > 1e-3
    np.testing.assert_allclose(left(runs_in, model_in), same, rtol=0.0, atol=1e-12)


def test_the_least_chance_need_not_be_the_worst_positions():
    """Of two that pass by simple acceptance the nearer to the limit is known better."""
    rows = [
        {
            "angle_deg": 0.0, "error_arcsec": e, "standard_arcsec": u,
            "degrees_of_freedom": None, "expanded_arcsec": 2.0 * u,
        }
        for e, u in [(8.0, 0.5), (7.0, 3.0)]
    ]  # fmt: skip
    from scipy.stats import norm

    found = conformity(Specification(10.0, "simple"), rows)
    assert found["worst"]["error_arcsec"] == 8.0
    assert found["conformance_probability"] == pytest.approx(norm.cdf(1.0) - norm.cdf(-17.0 / 3.0))


@pytest.mark.parametrize("period", UNITS)
def test_a_certificate_counts_readings_and_zeros(period):
    """Zeros of three runs scatter by 36 arcsec; one reading of two runs is off, in one row."""
    rng = np.random.default_rng(SEED + 5)
    turn = np.arange(72) / 72.0
    runs = []
    for number in range(3):
        error = 40.0 * np.sin(2.0 * np.pi * turn) + rng.normal(size=72) + 36.0 * (number - 1)
        error[20] += 300.0 * (number > 0)
        heat = np.full(72, (20.0, 19.0, 21.0)[number])
        read = period * (turn + error / ARCSEC)
        runs.append(ta.CalibrationRun(period * turn, read, period, temperature=heat))
    fit = ta.fit(runs, orders=[1], covariance="white")
    made = certify(runs, Identity("1", "joint"), fit=fit).content
    read = made["readings"]
    assert (read["readings"], read["runs"], read["mounts"], read["outliers"]) == (216, 3, 1, 2)
    assert read["zero_spread_arcsec"] == pytest.approx(36.0, abs=0.5)
    assert read["standard_deviation_arcsec"] == pytest.approx(1.0, abs=4.5 / np.sqrt(2.0 * 211.0))
    assert read["zero_deg"] == pytest.approx(0.0, abs=0.5 / 3600.0)
    assert made["temperature_recorded_C"] == {"mean": 20.0, "low": 19.0, "high": 21.0}
    (line,) = made["harmonics"]
    assert line["amplitude_arcsec"] == pytest.approx(40.0, abs=0.5)
    # Two of nearly 200 degrees of freedom.
    expected = 2.0 * read["standard_deviation_arcsec"] * np.sqrt(2.0 / 214.0)
    assert line["amplitude_expanded_arcsec"] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("period", UNITS)
def test_an_order_of_few_readings_has_their_factor(period):
    """Of 8 readings 5 degrees of freedom are left: 2.65 standard errors, of its phase too."""
    from scipy.stats import t

    turn = np.arange(8) / 8.0
    error = 40.0 * np.sin(2.0 * np.pi * turn + 0.5)
    error += np.random.default_rng(SEED + 6).normal(size=8)
    run = ta.CalibrationRun(period * turn, period * (turn + error / ARCSEC), period)
    fit = ta.fit(run, orders=[1])
    (line,) = certify(run, Identity("1", "joint"), fit=fit).content["harmonics"]
    factor = t.ppf(0.97725, 5)
    std = float(fit.amplitude_std[0]) * ARCSEC / period
    assert line["amplitude_expanded_arcsec"] == pytest.approx(factor * std)
    assert line["phase_expanded_deg"] == pytest.approx(factor * np.degrees(fit.phase_std[0]))
    assert line["phase_deg"] == pytest.approx(np.degrees(0.5), abs=5.0)


@pytest.mark.parametrize("beyond", [20.0, 250.0])
def test_the_budget_is_of_the_position_with_the_greatest_uncertainty(beyond):
    """Readings are few on one side of the turn: its row, and its lines make up what is there."""
    rng = np.random.default_rng([SEED, 5])
    runs = []
    for _ in range(3):
        dense = rng.uniform(0.0, 360.0, 200)
        x = np.sort(dense[(np.abs(dense - beyond) > 60.0) | (rng.uniform(size=200) < 0.1)])
        error = 0.02 * np.sin(np.radians(x - 100.0)) + 0.001 * rng.normal(size=x.size)
        runs.append(ta.CalibrationRun(x, x + error, 360.0))
    content = certify(runs, Identity("1", "joint"), orders=[1, 2, 3, 4]).content
    rows, budget = content["positions"], content["budget"]
    widest = max(rows, key=lambda row: row["expanded_arcsec"])
    assert min(abs(widest["angle_deg"] - beyond), 360.0 - abs(widest["angle_deg"] - beyond)) < 60.0
    for name in ("angle_deg", "standard_arcsec", "coverage_factor", "expanded_arcsec"):
        assert budget[name] == widest[name], name
    lines = np.array([line["standard_arcsec"] * line["sensitivity"] for line in budget["lines"]])
    assert np.sqrt(np.sum(lines**2)) == pytest.approx(widest["standard_arcsec"])


@pytest.mark.parametrize("places", [(), (0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_readings_are_a_models_own_where_any_file_of_them_is(places):
    runs = [
        ta.CalibrationRun([0.0, 1.0], [0.0, 1.0], 360.0, source=InputFile(f"{k}.csv", str(k) * 64))
        for k in range(3)
    ]
    inputs = (InputFile("elsewhere.csv", "9" * 64), *(InputFile("x", str(k) * 64) for k in places))
    plain = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0)
    model = plain.replace(provenance=Provenance(inputs))
    for order in (runs, runs[::-1]):
        assert is_of_these(model, order) == bool(places)
        assert not is_of_these(plain, order)
    without = [replace(run, source=None) for run in runs]
    assert not is_of_these(model, without)
