"""What a selection says beside its orders: errors, phases, repeats, what is held out, in words."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.fitting.orders.table import OrderRow

SEED = 71_000
THETA = np.arange(36) * 10.0


def runs_of(errors, theta=THETA, **more) -> list[ta.CalibrationRun]:
    return [ta.CalibrationRun(theta, theta + error, 360.0, **more) for error in errors]


def line(order, size, phase, theta=THETA):
    return size * np.sin(np.radians(order * theta + phase))


def noise(seed, count, size, sigma=0.001):
    return sigma * np.random.default_rng(seed).normal(size=(count, size))


def test_the_last_run_of_the_paper_tells_what_is_left_of_it() -> None:
    """Of 0.2 deg where the others have 0.15 a quarter stays, peak to peak at its positions."""
    errors = [line(5, size, 10.0) for size in (0.15, 0.15, 0.15, 0.2)]
    notes = ta.select_orders(runs_of(errors), candidates=range(1, 10), method="paper").notes
    (note,) = [n for n in notes if n.startswith("the last run verifies")]
    first, last, share = map(float, re.findall(r"\d+\.\d+", note))
    before = 3600.0 * float(np.ptp(errors[-1]))
    assert (first, last) == (pytest.approx(before, abs=0.01), pytest.approx(before / 4, abs=0.01))
    assert share == pytest.approx(75.0, abs=0.01)


@pytest.mark.parametrize("method", ["evidence", "paper"])
def test_a_row_tells_its_phase_with_error_and_spread(method: str) -> None:
    """Degrees across zero: 355, 359 and 5 lie within 10; the error is that along the circle."""
    print("seed", SEED)
    phases = (355.0, 359.0, 5.0, 359.0)
    errors = np.array([line(3, 0.1, p) for p in phases]) + noise(SEED, 4, 36)
    found = ta.select_orders(runs_of(errors), candidates=range(1, 8), method=method)
    (row,) = [row for row in found.to_dict()["orders"] if row["order"] == 3]
    # Of 36 readings a phase is known to 0.14 deg.
    assert row["phase_spread_deg"] == pytest.approx(10.0, abs=1.0)
    assert math.remainder(row["phase_deg"] + 0.5, 360.0) == pytest.approx(0.0, abs=1.0)
    given = found.row(3)
    assert row["phase_std_deg"] == given.phase_error_deg
    # Of the mean of four; the paper's of three (the last verifies), as if it were along both.
    near = np.std([-5.0, -1.0, 5.0, -1.0], ddof=1) / 2.0
    if method == "paper":
        near = np.std([-5.0, -1.0, 5.0], ddof=1) / math.sqrt(2.0 * 3.0)
    # By evidence what runs differ by has one variance along and across the amplitude.
    assert row["phase_std_deg"] == pytest.approx(near, rel=0.2 if method == "evidence" else 0.1)
    bare = OrderRow(3, True, "retained", 3.0, 4.0, 0.5, 9.0, -3.0, 0.5, 10.0)
    assert bare.phase_error_deg == pytest.approx(math.degrees(0.1))
    assert OrderRow(3, False, "noise", 0.0, 0.1, 0.5, 1.0, 0.0, 0.0, 1.0).phase_error_deg == 180.0


def test_closing_readings_are_told_by_the_worst() -> None:
    """Of three runs from 0 to 360 deg: 2, -7 and 4 arcsec from where they began."""
    theta = np.append(THETA, 360.0)
    errors = []
    for closing, extra in zip((2.0, -7.0, 4.0), noise(SEED + 1, 3, 37), strict=True):
        error = line(2, 0.1, 30.0, theta) + extra
        error[-1] = error[0] + closing / 3600.0
        errors.append(error)
    (note,) = [n for n in ta.select_orders(runs_of(errors, theta)).notes if "whole turns" in n]
    assert float(re.findall(r"by up to (\S+) arcsec", note)[0]) == pytest.approx(7.0, abs=0.01)


def test_turns_that_tell_a_gears_orders_are_half_a_cycle_of_their_difference() -> None:
    """Motor orders 7.3 and 14.6 beside 7 and 15: half a turn of 0.3 takes 1.67 turns."""
    theta = np.linspace(0.0, 400.0, 500)
    errors = [line(2, 0.1, 0.0, theta) + extra for extra in noise(SEED + 2, 3, 500)]
    found = ta.select_orders(runs_of(errors, theta), gear_ratio=7.3)
    (note,) = [n for n in found.notes if "cannot be separated" in n and "turns separate" in n]
    apart = [abs(float(a) - float(b)) for a, b in re.findall(r"([\d.]+) from ([\d.]+)", note)]
    told = float(re.findall(r"([\d.]+) turns separate", note)[0])
    assert told == pytest.approx(0.5 / min(apart), rel=0.01)
    assert min(apart) == pytest.approx(0.3, abs=1e-9)


def test_what_is_held_out_is_a_mean_by_weight() -> None:
    """The scale of weights is nobody's: four times all of them leaves every error in degrees."""
    rng = np.random.default_rng(SEED + 3)
    weight = rng.choice([0.5, 2.0], 36)
    errors = [line(2, 0.1, 20.0) + extra for extra in noise(SEED + 3, 5, 36, 0.01)]
    one, four = (
        ta.select_orders(runs_of(errors, weights=scale * weight), candidates=range(1, 8))
        for scale in (1.0, 4.0)
    )
    assert four.holdout_rms == pytest.approx(one.holdout_rms, rel=1e-9)
    before = [np.average((e - np.average(e, weights=weight)) ** 2, weights=weight) for e in errors]
    assert one.holdout_rms[0] == pytest.approx(math.sqrt(np.mean(before)), rel=1e-9)
    for row, other in zip(one.table, four.table, strict=True):
        assert other.standard_error == pytest.approx(row.standard_error, rel=1e-6)
        assert other.holdout_gain == pytest.approx(row.holdout_gain, rel=1e-6, abs=1e-9)
        assert other.log10_false_alarm == pytest.approx(row.log10_false_alarm, rel=1e-4, abs=1e-6)


def test_the_summary_lists_the_strongest_of_those_rejected() -> None:
    errors = [line(2, 0.1, 20.0) + extra for extra in noise(SEED + 4, 5, 36, 0.01)]
    found = ta.select_orders(runs_of(errors), candidates=range(1, 17))
    shown = {int(n) for n in re.findall(r"^ +(\d+) .*noise$", found.summary("arcsec"), re.M)}
    others = sorted(
        (row for row in found.table if not row.retained), key=lambda row: row.log10_false_alarm
    )
    assert len(shown) == 8
    assert shown == {row.order for row in others[:8]}


@pytest.mark.parametrize("seed", range(1, 13))
def test_a_refusal_tells_the_chance_of_its_strongest_order(seed: int) -> None:
    """In percent, to the digits that are shown, and how many were searched."""
    print("seed", seed)
    found = ta.select_orders(runs_of(noise(seed, 6, THETA.size)))
    best = max(found.table, key=lambda row: row.probability)
    said = re.search(r"order (\d+), the likeliest of (\d+), .* of only (\S+) %", found.reason)
    assert said is not None
    assert (int(said[2]), int(said[1])) == (len(found.table), best.order)
    assert float(said[3]) == float(f"{100.0 * best.probability:.2g}")


def test_the_paper_tells_what_is_needed_by_the_scatter_of_its_runs() -> None:
    errors = noise(SEED, 6, THETA.size) + line(5, 0.002, 10.0)
    found = ta.select_orders(runs_of(errors), range(1, 9), method="paper")
    for row in found.table:
        limit = stats.f.isf(0.005 / 8.0, 2, 8)
        assert row.needed == pytest.approx(row.standard_error * math.sqrt(2.0 * limit), rel=1e-9)
