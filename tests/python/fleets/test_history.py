"""Units calibrated again: drifted, damaged, exchanged, shifted, and nothing at all."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

import trueangle as ta
from trueangle.fleets.history import changes_of, charted
from trueangle.support.runlength import chart_limit

from .made import alone, units

SEED = 52_030
TWO = ("2026-01-10", "2026-07-10")
FOUR = ("2026-01-10", "2026-03-10", "2026-05-10", "2026-07-10")


def turned(rng, size):
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return size * np.array([np.cos(angle), np.sin(angle)])


def verdicts(found):
    return {u: v for u, v in found.verdicts().items() if v != "fine"}


@pytest.mark.parametrize("seed", range(SEED, SEED + 6))
def test_three_drifted_units_of_forty_are_found_and_none_else(seed):
    print("seed", seed)
    rng = np.random.default_rng(seed)

    def change(u, t, b):
        if t and u in (3, 8, 21):
            b[u % 4] += turned(rng, 25.0)
        return b, 60.0 * (u == 30 and t)

    found = ta.fleet(units(rng, dates=TWO, change=change), orders=range(1, 5))
    drifted = dict.fromkeys(("u3", "u8", "u21"), "recalibrate")
    assert verdicts(found) == {**drifted, "u30": "zero_moved"}


def test_runs_of_one_day_are_one_calibration_whatever_the_hour():
    print("seed", SEED)
    runs = units(np.random.default_rng(SEED + 40), 12, dates=TWO, runs=2)
    timed = [
        replace(run, when=f"{run.when}T{8 + 5 * int(run.label[1:]):02d}:30:00") for run in runs
    ]
    found, same = (ta.fleet(those, orders=[1, 2]).to_dict() for those in (timed, runs))
    for row in found["history"]:
        row["when"] = row["when"][:10]
    assert found == same
    assert {row["when"] for row in found["history"]} == {TWO[1]}
    assert len(found["history"]) == 12


def test_clean_fleets_are_silent():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 50)
    told = [verdicts(ta.fleet(units(rng, 20, dates=TWO), orders=range(1, 5))) for _ in range(12)]
    assert sum(map(bool, told)) <= 1


def test_damage_an_exchange_and_a_new_part_are_changes():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 60)
    kept = {}

    def change(u, t, b):
        kept.setdefault(u, b)
        if not t:
            return b, 0.0
        if u == 2:
            b[0] += [110.0, 0.0]
        if u == 5:
            return rng.normal(0.0, 10.0, (4, 2)), 0.0
        return b, 0.0

    runs = units(rng, dates=TWO, change=change)
    swap = {"u10": "u11", "u11": "u10"}
    runs = [replace(r, unit=swap.get(r.unit, r.unit)) if r.when == TWO[1] else r for r in runs]
    found = ta.fleet(runs, orders=range(1, 5))
    assert verdicts(found) == dict.fromkeys(("u2", "u5", "u10", "u11"), "changed")
    because = {unit.unit: unit.because for unit in found.units}
    assert "order 1" in because["u2"]
    assert "replaced" in because["u5"]
    assert "u11" in because["u10"]
    assert "exchanged" in because["u10"]


def test_several_dates_tell_a_drift_from_a_step():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 70)

    def change(u, t, b):
        b[0] += np.array([12.0 * t, 0.0]) * (u == 1)
        b[1] += np.array([0.0, 30.0 * (t >= 2)]) * (u == 4)
        return b, 0.0

    found = ta.fleet(units(rng, 20, dates=FOUR, change=change), orders=[1, 2])
    assert verdicts(found) == {"u1": "recalibrate", "u4": "changed"}
    assert len(found.history) == 20 * 3
    last = [row for row in found.history if row.unit == "u1"][-1]
    assert last.order == 1.0
    assert last.statistic > last.limit


def test_the_charts_are_sums_of_independent_normal_numbers_where_nothing_moves():
    """Against a recursion written out, and the limit against how often it is passed."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 75)
    dates = [f"2026-{month:02}-10" for month in range(1, 13)]
    found = ta.fleet(units(rng, 30, dates=dates, runs=1), orders=range(1, 5))
    rows = [row for row in found.history if row.unit == "u0"]
    assert [one.order for one in rows[0].orders] == [1.0, 2.0, 3.0, 4.0]
    assert len(rows) == 11
    assert rows[0].cusum_limit == pytest.approx(chart_limit(0.5, 465.44 * 8.0))
    passed = sum(
        one.cusum > row.cusum_limit for row in found.history for one in row.orders
    )  # 330 dates of a unit: less than one alarm in 465
    assert passed <= 4
    text = json.loads(found.to_json())["history"][0]
    assert set(text["orders"][0]) == {"order", "statistic", "cusum"}


def moved_by_hand(rng, count, zero=0.0, step=0.0):
    """Units of two orders on three dates; the zero and the first order of the last one moved."""
    found = []
    for u in range(count):
        dates, last = [], u == count - 1
        for t, when in enumerate(FOUR[:3]):
            coefficients = rng.normal(0.0, 1.0, 4) + np.eye(4)[0] * (step * last * (t > 0))
            made = replace(alone(0.0, 0.0, when), inverse=np.zeros((4, 4)), unit=f"u{u}")
            shift = rng.normal() + zero * last * (t == 2)
            dates.append((replace(made, coefficients=coefficients, zero=shift), 1.0))
        found.append(dates)
    return found


@pytest.mark.parametrize("count", [6, 7, 12])
def test_a_zero_that_moved_is_told_by_students_bound_of_all_units(count):
    """Externally studentized: against mean and scatter of the others, a half of 1 % for all."""
    print("seed", SEED)
    dated = moved_by_hand(np.random.default_rng(SEED + 77), count, zero=40.0)
    found = changes_of(dated, np.array([1.0, 2.0]), 360.0, np.ones(2), None)
    row = found[-1].rows[-1]
    assert (row.verdict, row.order) == ("zero_moved", None)
    bound = student.ppf(1.0 - 0.005 / (2 * count), count - 2)
    assert row.limit == pytest.approx(bound**2, rel=1e-6)
    *others, moved = [dates[-1][0].zero - dates[0][0].zero for dates in dated]
    spread = np.std(others, ddof=1) * np.sqrt(1.0 + 1.0 / len(others))
    assert row.statistic == pytest.approx(((moved - np.mean(others)) / spread) ** 2)
    assert [one.unit for one in found if one.zero_moved] == [f"u{count - 1}"]


@pytest.mark.parametrize("count", [6, 12])
@pytest.mark.parametrize(("zero", "step"), [(0.0, 0.0), (40.0, 0.0), (0.0, 60.0), (40.0, 60.0)])
def test_every_earlier_date_is_told_by_the_order_its_statistic_is_of(count, zero, step):
    """The bound of T^2 by its closed form: the tail of F with 2 degrees of freedom above."""
    print("seed", SEED)
    dated = moved_by_hand(np.random.default_rng(SEED + 78), count, zero, step)
    found = changes_of(dated, np.array([1.0, 2.0]), 360.0, np.ones(2), None)
    freedom = 2.0 * (count - 1)
    for change in found:
        assert [row.when for row in change.rows] == [*FOUR[1:3]]
        for row in change.rows:
            of_zero = change.zero_moved and not change.moved and row is change.rows[-1]
            assert (row.order is None) == of_zero
            if not of_zero:
                tail = (1.0 + row.limit / freedom) ** (-freedom / 2.0)
                assert tail == pytest.approx(0.005 / (2 * count))
                statistics = {one.order: one.statistic for one in row.orders}
                assert row.statistic == statistics[row.order]
        first = change.rows[0]
        assert (first.verdict == "recalibrate") == (first.statistic > first.limit)
        assert (first.next_calibration, first.bound, first.extrapolated) == (None, None, False)
    assert (found[-1].rows[0].verdict == "recalibrate") == (step > 0.0)


def test_the_sums_are_those_of_the_recursion():
    values = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, -1.0], [9.0, 0.0]])
    dated = [(replace(alone(0.5, 0.1), coefficients=v), 4.0) for v in values]
    upper, expected = np.zeros(4), []
    for t in range(1, 4):
        # A date's variance: noise 4 times 0.5, and half of the 2 of an ordinary change.
        z = (values[t] - values[:t].mean(axis=0)) / np.sqrt(3.0 * (1.0 + 1.0 / t))
        upper = np.maximum(upper + np.concatenate([z, -z]) - 0.5, 0.0)
        expected.append([upper.max()])
    assert charted(dated, np.array([2.0])) == pytest.approx(np.array(expected))


def test_the_picture_of_a_unit_over_months():
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    rng = np.random.default_rng(SEED + 76)
    found = ta.fleet(units(rng, 8, dates=FOUR), orders=[1, 2])
    ax = found.plot("history", unit="u2")
    ax.figure.canvas.draw()
    assert len(ax.figure.axes) == 2
    pyplot.close("all")


def test_the_next_calibration_is_when_the_bound_of_the_drift_reaches_the_permitted_error():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 80)

    def change(u, t, b):
        b[0] += np.array([20.0 * t, 0.0]) * (u == 1)
        return b, 0.0

    runs = units(rng, 20, dates=TWO, change=change, noise=0.1)
    found = ta.fleet(runs, orders=range(1, 5), permitted_arcsec=40.0)
    due = {row.unit: row for row in found.history}
    # 20 arcsec in 181 days: 40 arcsec after twice as long, 2027-01-07, and the bound is earlier.
    assert "2026-12-20" < due["u1"].next_calibration <= "2027-01-07"
    assert due["u2"].extrapolated
    none = ta.fleet(runs, orders=[1, 2])
    assert all(row.next_calibration is None for row in none.history)


def test_a_few_histories_tell_nothing_and_say_so():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 90)
    runs = units(rng, 8) + units(rng, 2, dates=TWO[1:])
    runs = [
        r
        if r.when
        else ta.CalibrationRun(r.reference, r.indicated, 360.0, unit=r.unit, when=TWO[0])
        for r in runs
    ]
    found = ta.fleet(runs, orders=[1, 2])
    assert not found.history
    assert any("4 are needed" in note for note in found.notes)
