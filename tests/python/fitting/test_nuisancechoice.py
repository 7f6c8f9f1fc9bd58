"""Nuisances chosen and fitted, against sums written out; taken out in any unit and turn."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.nuisancechoice import (
    FOLDS,
    FoldRows,
    _held_out,
    choose_nuisance_groups,
    error_inflation,
    reference_lines_help,
    solve_with_groups,
)
from trueangle.fitting.nuisanceremoval import take_out_nuisance
from trueangle.joint.shafts import ShaftOrders

SEED = 48_900
SHAFTS = [ShaftOrders("output", 1.0, (1, 2, 4))]


def rows_of(rng, travel=np.pi, late=0.5):
    """Orders 1, 2 and 4 over a travel, a ramp, the speed, and a group that tells nothing."""
    x = np.sort(rng.uniform(0.0, travel, 600))
    pattern = np.column_stack([f(k * x) for f in (np.cos, np.sin) for k in (1, 2, 4)])
    groups = {
        "ramp": x[:, None],
        "velocity": rng.normal(size=(600, 1)),
        "direction": rng.choice([-1.0, 1.0], (600, 1)),
    }
    error = pattern @ rng.normal(size=6) + x + late * groups["velocity"][:, 0]
    error = error + 0.3 * rng.normal(size=600)
    about = {name: columns - columns.mean(axis=0) for name, columns in groups.items()}
    pattern = pattern - pattern.mean(axis=0)
    return FoldRows(pattern, about, error - error.mean(), np.arange(600) * 12 // 600 % FOLDS)


@pytest.mark.parametrize("chosen", [["ramp"], ["ramp", "velocity"], ["direction"], []])
def test_errors_grow_for_each_coefficient_in_its_place(chosen):
    """Cosine and sine of the first order, then of the next: roots of the inverses' diagonals."""
    print("seed", SEED)
    rows = rows_of(np.random.default_rng(SEED))
    found = error_inflation(rows, chosen)
    wanted = []
    for order in range(3):
        for column in (order, order + 3):  # cosines stand before the sines
            own = rows.pattern[:, column]
            left = []
            for beside in ([], chosen):
                others = np.delete(rows.pattern, column, axis=1)
                design = np.hstack([others, *(rows.groups[name] for name in beside)])
                rest = own - design @ np.linalg.lstsq(design, own, rcond=None)[0]
                left.append(float(rest @ rest))
            wanted.append(np.sqrt(left[0] / left[1]))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    if "ramp" in chosen:
        assert max(wanted) > 1.5 * min(wanted)


def by_folds(rows, chosen):
    """The error held out: every fold under least squares of the others."""
    design = np.hstack([rows.pattern, *(rows.groups[name] for name in chosen)])
    total = 0.0
    for fold in range(FOLDS):
        held = rows.fold == fold
        fitted = np.linalg.lstsq(design[~held], rows.error[~held], rcond=None)[0]
        total += float(((rows.error[held] - design[held] @ fitted) ** 2).sum())
    return total


def test_shares_are_of_the_error_that_there_was_at_first():
    """Of all together it is what is gone in the end, whichever comes first."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    orders = set()
    for late in (0.3, 1.0, 30.0):
        rows = rows_of(rng, travel=6.0 * np.pi, late=late)
        chosen, shares, _ = choose_nuisance_groups(rows, [])
        assert {"ramp", "velocity"} <= set(chosen)
        assert [name for name, _ in shares] == chosen
        orders.add(tuple(chosen[:2]))
        first, before = by_folds(rows, []), by_folds(rows, [])
        np.testing.assert_allclose(_held_out(rows, []).sum(), first, rtol=1e-5)
        for k, (name, share) in enumerate(shares):
            after = by_folds(rows, chosen[: k + 1])
            assert share == pytest.approx((before - after) / first, rel=1e-4), name
            before = after
        assert sum(share for _, share in shares) == pytest.approx(1.0 - before / first, rel=1e-4)
    assert len(orders) == 2


def folds_of(rng, sizes, shares):
    """A group of such a size and coefficient in each fold, at right angles to all else there."""
    fold = np.repeat(np.arange(FOLDS), 60)
    columns = np.zeros((fold.size, 5))
    for f in range(FOLDS):
        columns[fold == f] = np.linalg.qr(rng.normal(size=(60, 5)))[0]
    pattern, (group, idle, rest) = columns[:, :2], columns.T[2:, :, None]
    group = group * np.array(sizes)[fold, None]
    error = (group * np.array(shares)[fold, None] + 3.0 * rest)[:, 0]
    groups = {"direction": group, "turned": group, "reference": idle}
    return FoldRows(pattern, groups, error, fold)


@pytest.mark.parametrize(
    ("sizes", "shares", "taken"),
    [
        # One fold of much is not most of them; where the others agree by half it is taken.
        ((10.0, 1.0, 1.0), (1.0, 0.45, 0.45), False),
        ((10.0, 1.0, 1.0), (1.0, 0.55, 0.55), True),
        # One that gets worse is outvoted.
        ((10.0, 10.0, 1.0), (1.0, 1.0, 0.1), True),
        # A hundredth of the sum of squares, 27 beside it.
        ((1.0, 1.0, 1.0), (0.299,) * 3, False),
        ((1.0, 1.0, 1.0), (0.304,) * 3, True),
    ],
)
def test_what_lowers_most_folds_and_their_sum_is_taken(sizes, shares, taken):
    print("seed", SEED + 3)
    rows = folds_of(np.random.default_rng(SEED + 3), sizes, shares)
    assert reference_lines_help(rows) is taken
    only = rows._replace(groups={"direction": rows.groups["direction"]})
    assert choose_nuisance_groups(only, [])[0] == (["direction"] if taken else [])


def test_groups_are_fitted_beside_the_pattern():
    rows = rows_of(np.random.default_rng(SEED + 2))
    design = np.hstack([rows.pattern, rows.groups["velocity"], rows.groups["ramp"]])
    wanted = np.linalg.lstsq(design, rows.error, rcond=None)[0][-2:]
    found = solve_with_groups(rows, ["velocity", "ramp"])
    np.testing.assert_allclose([found["velocity"][0], found["ramp"][0]], wanted, rtol=1e-6)


def swept(unit=360.0, turns=0, seed=SEED):
    """Runs there and back with a ramp, play, a delay and a drift of each."""
    runs = []
    for number in range(3):
        rng = np.random.default_rng([seed, number])
        t = np.arange(0.0, 40.0, 0.05)
        x = 1.0 - np.cos(0.2 * t + 0.05 * number * np.sin(t))
        way = np.sign(np.gradient(x, t))
        error = 1e-4 * np.sin(2.0 * np.pi * x) + 3e-5 * x + 2e-5 * way + 1e-4 * np.gradient(x, t)
        error += 5e-5 * (t / 40.0) ** 2 * (number + 1) + 2e-6 * rng.normal(size=t.size)
        x = x + turns
        runs.append(ta.CalibrationRun(unit * x, unit * (x + error + 0.1 * number), unit, time=t))
    return runs


@pytest.mark.parametrize("kinds", [("ramp",), ("ramp", "direction"), ("ramp", "velocity", "drift")])
def test_what_is_left_does_not_depend_on_turns_units_or_the_order_of_runs(kinds):
    def left(runs):
        cleaned, found = take_out_nuisance(runs, kinds, SHAFTS, "reference")
        assert set(found.kinds) == set(kinds)
        return [run.centred_error / run.period for run in cleaned]

    wanted = left(swept())
    for unit, turns in ((360.0, 7), (2.0 * np.pi, 0), (2.0 * np.pi, -3), (8192.0, 40)):
        for one, other in zip(left(swept(unit, turns)), wanted, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9)
    for one, other in zip(left(swept()[::-1])[::-1], wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9)


def test_a_ramp_moves_no_zero():
    """It is taken off about the middle of each run: what a zero is told by stays."""
    runs = swept()
    cleaned, found = take_out_nuisance(runs, ("ramp",), SHAFTS, "reference")
    assert found.slope == pytest.approx(3e-5, abs=3e-5)
    for before, after in zip(runs, cleaned, strict=True):
        gone = before.indicated - after.indicated
        assert abs(float(gone.mean())) < 1e-9
        np.testing.assert_allclose(
            np.diff(gone), found.slope * np.diff(before.reference), atol=1e-12
        )
