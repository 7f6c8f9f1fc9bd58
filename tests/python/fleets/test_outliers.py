"""Outliers among units: how often a clean fleet is told of one, and what is found."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal, stats
from scipy.stats import f

import trueangle as ta
from trueangle.fleets.calibration import Calibration
from trueangle.fleets.outliers import _variance, deviates, level_by_order
from trueangle.fleets.units import Units, louder_orders
from trueangle.joint.shafts import ShaftOrders
from trueangle.reports.fleet import FleetReport

from .made import ARCSEC, pattern, units

SEED = 52_020


def drawn(rng, count, orders):
    return [rng.normal(size=(count, 2)) for _ in range(orders)]


@pytest.mark.parametrize(("count", "orders"), [(12, 3), (40, 3), (40, 17)])
def test_clean_fleets_are_told_of_one_in_a_hundred_at_most(count, orders):
    print("seed", SEED)
    rng = np.random.default_rng(SEED + count)
    fleets, own = 800, [np.zeros((count, 2, 2))] * orders
    shares = level_by_order(np.arange(1.0, orders + 1.0))
    told = sum(
        deviates(drawn(rng, count, orders), own, True, shares=shares).outlying.any()
        for _ in range(fleets)
    )
    # 1 % and three standard deviations of the count.
    assert told <= 0.01 * fleets + 3.0 * np.sqrt(0.01 * fleets)


@pytest.mark.parametrize("orders", [3, 17])
def test_an_eccentric_unit_is_found(orders):
    """However many orders are looked at beside that of eccentricity."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    own, found, others = [np.zeros((40, 2, 2))] * orders, 0, 0
    shares = level_by_order(np.arange(1.0, orders + 1.0))
    for _ in range(200):
        values = drawn(rng, 40, orders)
        values[0][7] += [6.5, 0.0]
        outlying = deviates(values, own, True, shares=shares).outlying
        found += outlying[7]
        others += outlying.sum() > 1 and outlying[7]
    # 95 %, and three standard deviations of the count.
    print("found", found)
    assert found >= 181
    assert others <= 6


def test_a_unit_set_aside_before_a_hidden_outlier_is_none_by_that():
    """Five far off in one order hide one in another; before, half of the fleets had a sixth."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    own, found, others = [np.zeros((24, 2, 2))] * 4, 0, 0
    for _ in range(100):
        values = drawn(rng, 24, 4)
        values[1][:5] += 60.0 * np.array([[np.cos(u), np.sin(u)] for u in range(5)])
        values[0][5] += [9.0, 0.0]
        told = deviates(values, own, True, shares=level_by_order(np.arange(1.0, 5.0)))
        found += told.outlying[:6].all()
        others += told.outlying[6:].any()
        assert (told.unit[told.outlying] <= told.limit).all()
    print(found, others)
    assert found >= 75
    assert others <= 4


def test_several_outliers_do_not_hide_each_other():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    values = drawn(rng, 40, 3)
    values[0][:4] = rng.normal([12.0, 3.0], 1.0, (4, 2))
    outlying = deviates(values, [np.zeros((40, 2, 2))] * 3, True).outlying
    assert np.flatnonzero(outlying).tolist() == [0, 1, 2, 3]


def test_the_unit_its_order_and_the_likely_cause_are_named():
    """And the unit whose residual is eight times that of the others, in text and report."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)

    def eccentric(u, t, b):
        return b + (u == 11) * np.array([[65.0, 0.0], *3 * [[0.0, 0.0]]]), 0.0

    runs = units(rng, change=eccentric)
    for k, run in enumerate(runs):
        further = rng.normal(0.0, 63.0**0.5 * 3.0 * ARCSEC, len(run)) * (run.unit == "u7")
        runs[k] = replace(run, indicated=run.indicated + further)
    found = ta.fleet(runs, orders=range(1, 5))
    first, louder = sorted(found.units[:2], key=lambda unit: unit.unit)
    assert (first.unit, louder.unit) == ("u11", "u7")
    assert re.search("order 1 .*eccentricity", first.because)
    assert re.match(r"residual of 2\d.* arcsec is (7|8)(\.\d)? times the fleet's", louder.because)
    assert all(
        "u7" in page and "median" in page for page in (found.summary(), FleetReport(found).html)
    )
    assert [unit.verdict for unit in found.units] == ["outlier"] * 2 + ["fine"] * 38
    assert found.aligned


def test_no_verdict_contradicts_its_p():
    """Fine means above the limit, or says why not; all others are at it or below."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 4)

    def wide(u, t, b):
        return b * (12.0 if u < 6 else 1.0), 0.0

    for change in (wide, lambda u, t, b: (b, 0.0)):
        found = ta.fleet(units(rng, 16, change=change), orders=[1, 2])
        for unit in found.units:
            assert (unit.p > unit.limit) == (not unit.because)
            assert unit.p <= unit.limit or unit.verdict == "fine"
    assert "limit" in found.summary()


def test_a_few_units_tell_no_outlier():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 3)
    found = ta.fleet(units(rng, 4), orders=[1, 2])
    assert all(unit.verdict == "fine" for unit in found.units)
    assert any("5 are needed" in note for note in found.notes)


@pytest.mark.parametrize("aligned", [True, False])
def test_a_distance_is_that_from_the_others_in_their_own_scatter(aligned):
    """Left out and looked at from the others, one by one: known exactly, none outlying."""
    print("seed", SEED)
    values = np.random.default_rng(SEED + 70).normal(0.0, 1.0, (11, 2))
    found = deviates([values], [np.zeros((11, 2, 2))], aligned)
    assert not found.outlying.any()
    for u in range(11):
        others = np.delete(values, u, axis=0)
        mean = others.mean(axis=0) if aligned else np.zeros(2)
        freedom = 2.0 * (9.0 if aligned else 10.0)
        scatter = ((others - mean) ** 2).sum() / freedom
        square = ((values[u] - mean) ** 2).sum() / scatter / (1.1 if aligned else 1.0)
        assert found.size[u, 0] == pytest.approx(np.sqrt(square), rel=1e-9)
        assert found.chance[u, 0] == pytest.approx(f.sf(square / 2.0, 2.0, freedom), rel=1e-9)
    assert found.limit == pytest.approx(0.8 * 0.01 / 11.0)


def test_a_unit_set_aside_is_seen_from_the_others_and_the_limit_is_theirs():
    print("seed", SEED)
    values = np.random.default_rng(SEED + 71).normal(0.0, 1.0, (21, 2))
    values[7] = [30.0, 0.0]
    found = deviates([values], [np.zeros((21, 2, 2))], True)
    assert found.outlying.nonzero()[0].tolist() == [7]
    others = np.delete(values, 7, axis=0)
    scatter = ((others - others.mean(axis=0)) ** 2).sum() / 38.0
    square = ((values[7] - others.mean(axis=0)) ** 2).sum() / scatter / 1.05
    assert found.size[7, 0] == pytest.approx(np.sqrt(square), rel=1e-9)
    assert found.limit == pytest.approx(0.8 * 0.01 / 20.0)


@pytest.mark.parametrize("aligned", [True, False])
@pytest.mark.parametrize("size", [1, 2])
@pytest.mark.parametrize("between", [0.0, 0.5, 20.0])
def test_the_variance_between_units_is_without_that_of_their_noise(between, size, aligned):
    """Of zeros as of orders, by draws: noise alone leaves what a median scatters by, half the time.

    In units of the mean noise, which is unlike from unit to unit by half of it.
    """
    print("seed", SEED)
    rng = np.random.default_rng([SEED, size, int(2 * between)])
    found = []
    for _ in range(60):
        noise = rng.uniform(0.5, 1.5, 300)
        values = rng.normal(size=(300, size)) * np.sqrt(between + noise)[:, None]
        values += 7.0 * aligned
        own = noise[:, None, None] * np.eye(size)
        found.append(_variance(values, own, aligned))
    # A variance by its median scatters by 2.33 / sqrt n in one dimension, 1.44 / sqrt n in two.
    spread = (2.33 if size == 1 else 1.45) / np.sqrt(300.0) * (between + 1.0)
    # Of a normal number cut off at nought the mean is 0.4 of its deviation.
    wanted = between or 0.4 * spread
    # Unlike noise has a lower median than the normal of its mean: by 4 % of it at most here.
    low = 0.04 * (between == 0.5) + 0.015 * (between == 0.0)
    margin = 4.5 * spread / np.sqrt(60.0)
    assert wanted - margin - low <= np.mean(found) <= wanted + margin


@pytest.mark.parametrize("size", [1, 2])
def test_units_that_are_known_worse_are_not_named_for_it(size):
    """A tenth of the units with twenty times the variance of the others, and nothing between."""
    print("seed", SEED + 9)
    rng = np.random.default_rng([SEED + 9, size])
    noise = np.where(np.arange(40) < 4, 20.0, 1.0)
    own, told = [noise[:, None, None] * np.eye(size)], 0
    for _ in range(400):
        values = [rng.normal(size=(40, size)) * np.sqrt(noise)[:, None]]
        told += bool(deviates(values, own, True).outlying.any())
    # Weights by a variance that is not there are as of its error: some more than 1 %.
    assert told <= 12


def hiding_fleet(seed):
    """Units in any number: one off in amplitude, one in phase, one with its own order 4, two turned
    by half a turn."""
    rng = np.random.default_rng(seed)
    count, places = int(rng.integers(16, 44)), np.arange(0.0, 360.0, 6.0)
    odd = rng.choice(count, 5, replace=False).tolist()
    runs = []
    for u in range(count):
        own = np.array([[25.0, 60.0], [0.0, 30.0], [12.0, -12.0], [0.0, 0.0]])
        own += rng.normal(0.0, 8.0, (4, 2)) * np.array([[1.0], [0.6], [0.4], [0.1]])
        own[0] += np.array([-90.0, -60.0]) * (u == odd[0])
        own[1] += np.array([60.0, 50.0]) * (u == odd[1])
        own[3] += np.array([0.0, 28.0]) * (u == odd[2])
        own *= -1.0 if u in odd[3:] else 1.0
        error = pattern(own, places) + rng.normal(0.0, 3.0 / 3600.0, places.size)
        runs.append(ta.CalibrationRun(places, places + error, 360.0, unit=f"u{u}"))
    return runs, {f"u{u}" for u in odd}


def test_outliers_do_not_decide_whether_the_others_share_a_mean():
    """An outlier that only a common mean shows once turned the mean off, and hid by that."""
    for seed in range(900, 940):
        runs, odd = hiding_fleet(seed)
        if len({run.unit for run in runs}) > 20:
            continue
        found = ta.fleet(runs, orders=[1, 2, 3, 4])
        named = {unit for unit, verdict in found.verdicts().items() if verdict != "fine"}
        assert found.aligned, seed
        assert named == odd, seed


REPEATS_SEED = 52_400


def drift(rng: np.random.Generator, size: int) -> np.ndarray:
    return 8.0 * rng.normal() * np.linspace(-1.0, 1.0, size)


def memory(rng: np.random.Generator, size: int) -> np.ndarray:
    return 3.0 * signal.lfilter([0.6], [1.0, -0.8], rng.normal(size=size + 99))[99:]


def nothing(rng: np.random.Generator, size: int) -> np.ndarray:
    return np.zeros(size)


@pytest.mark.parametrize("more", [nothing, drift, memory])
def test_errors_of_units_are_what_they_scatter_by(
    more: Callable[[np.random.Generator, int], np.ndarray],
) -> None:
    """Amplitudes of ten units in three runs each: 3.2 errors (rms) of a drift, 3.0 of memory."""
    print("seeds", REPEATS_SEED, "to", REPEATS_SEED + 9)
    pulls = []
    for seed in range(REPEATS_SEED, REPEATS_SEED + 10):
        rng = np.random.default_rng(seed)
        own: dict[str, np.ndarray] = {}

        def kept(u, t, b, own=own):
            own[f"u{u}"] = b.copy()
            return b, 0.0

        places = np.arange(0.0, 360.0, 3.0)
        runs = [
            ta.CalibrationRun(
                run.reference,
                run.indicated + ARCSEC * more(rng, len(run)),
                360.0,
                unit=run.unit,
                label=run.label,
            )
            for run in units(rng, 10, noise=1.0, change=kept, places=places)
        ]
        for unit in ta.fleet(runs, orders=[1, 2, 3, 4]).units:
            sizes = np.hypot(*own[unit.unit].T)
            for size, order in zip(sizes, unit.orders, strict=True):
                if size > 5.0 * order.std / ARCSEC:
                    pulls.append((order.amplitude - ARCSEC * size) / order.std)
    rms = float(np.sqrt(np.mean(np.square(pulls))))
    print(len(pulls), rms)
    # Some 380 numbers: 4 %, and what sixty degrees of freedom tell of each order, 9 %.
    assert 0.8 < rms < 1.2


def test_runs_differ_by_more_than_readings_from_one_percent_on() -> None:
    """Two orders of twelve degrees of freedom each: the limit is that of half a per cent."""
    limit = stats.chi2.isf(0.005, 12.0) / 12.0
    for ratio, kept in ((0.99 * limit, 1.0), (1.01 * limit, 1.01 * limit)):
        one = Calibration(
            unit="u",
            when=None,
            coefficients=np.zeros(4),
            inverse=np.eye(4),
            zero=0.0,
            zero_inverse=1.0,
            squares=1.0,
            freedom=9.0,
            readings=36,
            runs=7,
            repeat_squares=np.full(2, 12.0 * ratio),
            repeat_freedom=12.0,
            repeat_white=np.full(2, 6.0),
        )
        found = louder_orders([one], np.array([2.0]))
        assert found == pytest.approx(np.full(2, kept))
        louder = replace(one, louder=found).blocks()
        assert louder == pytest.approx(kept * one.blocks())


def calibration(number: int, squares: float, apart: float) -> Calibration:
    """Of one order in three runs of 40 readings, of variance 2 within runs."""
    return Calibration(
        unit=f"u{number}",
        when=None,
        coefficients=np.array([1.0, 2.0]) * number,
        inverse=np.eye(2) / 60.0,
        zero=0.0,
        zero_inverse=1.0 / 120.0,
        squares=squares,
        freedom=115.0,
        readings=120,
        runs=3,
        repeat_squares=np.array([apart]),
        repeat_freedom=4.0,
        repeat_white=np.array([4.0 / 20.0]),
        within_squares=2.0 * 111.0,
        within_freedom=111.0,
    )


def test_what_runs_differ_by_is_no_noise_of_their_unit() -> None:
    """Squares about the common pattern hold what a few runs drew: units seem to differ by it."""
    shafts = [ShaftOrders("output", 1.0, (1,))]
    alike = [[calibration(k, 2.0 * 115.0, 0.4)] for k in range(8)]
    units = Units(alike, shafts, 360.0)
    assert units.noise.units == pytest.approx(np.full(8, 2.0))
    assert units.run_variance is None
    apart = [[calibration(k, 2.0 * 111.0 + 20.0 * s, s)] for k, s in enumerate(range(4, 12))]
    units = Units(apart, shafts, 360.0)
    assert units.noise.units == pytest.approx(np.full(8, 2.0))
    # Mean of the sums by their freedom, less 2/20 that noise makes of a coefficient of one run.
    assert units.run_variance == pytest.approx(np.full(2, 7.5 / 4.0 - 0.1))
    assert units.own[0] == pytest.approx(np.tile(7.5 / 4.0 / 3.0 * np.eye(2), (8, 1, 1)))
