"""Positions, folding and explanations of orders."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.fitting.orders.verdicts import verified_positions
from trueangle.joint.gear import explain_order, gear_orders
from trueangle.runs.aliasing import (
    closure_errors,
    distinct_positions,
    energy_near_nyquist,
    fold,
    position_coherence,
)


def run_at(angles, period=360.0):
    angles = np.asarray(angles, dtype=float)
    return ta.CalibrationRun(angles, angles, period=period)


# Orders behind 36 positions, with the sign of the fold.
FOLDS = {98: -10, 99: -9, 100: -8, 101: -7, 102: -6, 199: -17, 200: -16, 201: -15, 202: -14}
FOLDS |= {203: -13, 204: -12, 300: 12, 302: 14, 303: 15, 400: 4, 402: 6, 404: 8, 500: -4, 600: -12}


@pytest.mark.parametrize(
    ("ratio", "member", "folded"),
    [
        (30, "circular_spline", [6, 5, 12, 11, 10, 18, 12]),
        (50, "circular_spline", [14, 15, 8, 7, 6, 6, 16]),
        (80, "circular_spline", [8, 9, 16, 17, 18, 12, 4]),
        (100, "circular_spline", [8, 7, 16, 15, 14, 12, 4]),
        (101, "flexspline", [7, 8, 14, 15, 16, 15, 8]),
        (120, "circular_spline", [12, 13, 12, 11, 10, 0, 12]),
        (160, "circular_spline", [16, 17, 4, 3, 2, 12, 8]),
    ],
)
def test_orders_fold_as_tabulated(ratio, member, folded):
    assert {k: math.prod(fold(k, 36)) for k in FOLDS} == FOLDS
    assert [fold(int(m), 36)[0] for m in gear_orders(ratio, member)] == folded


def test_flexspline_fixed_names_orders_below_the_ratio():
    assert list(gear_orders(101, "flexspline")) == [101, 100, 202, 201, 200, 303, 404]
    assert "circular spline" in gear_orders(101, "flexspline")[202]
    assert "flexspline" in gear_orders(101, "flexspline")[200]


@given(st.integers(0, 2000), st.integers(3, 400))
def test_fold_reproduces_the_samples(order, divisions):
    x = 2.0 * np.pi * np.arange(divisions) / divisions
    folded, sign = fold(order, divisions)
    # Rounding of order * x, in radians.
    rounding = 1e-15 * (order + 1) * 2.0 * np.pi * 4
    np.testing.assert_allclose(np.cos(order * x), np.cos(folded * x), atol=rounding)
    np.testing.assert_allclose(np.sin(order * x), sign * np.sin(folded * x), atol=rounding)


def test_thirty_seven_readings_are_thirty_six_positions():
    positions = distinct_positions(run_at(np.arange(37) * 10.0))
    assert len(positions) == 36
    assert positions.divisions == 36
    assert positions.highest_order == 17
    assert positions.index[0] == positions.index[36]
    assert positions.describe() == "36 distinct positions, 10 deg apart"


@given(
    st.floats(-1000.0, 1000.0),
    st.integers(-3, 3),
    st.sampled_from([360.0, 2 * np.pi, 1.0, 65536.0]),
    st.randoms(use_true_random=False),
)
def test_positions_do_not_depend_on_turns_unit_zero_and_row_order(zero, turn, period, random):
    angles = [zero / 360.0 + turn * (j % 3) + j / 36.0 for j in range(37)]
    random.shuffle(angles)
    positions = distinct_positions(run_at(np.array(angles) * period, period))
    assert (len(positions), positions.divisions) == (36, 36)


def test_jitter_within_the_tolerance_is_one_position():
    random = np.random.default_rng(1)
    runs = [
        run_at(np.arange(36) * 10.0 + random.uniform(-0.004, 0.004, 36) - 20.0) for _ in range(6)
    ]
    assert len(distinct_positions(runs)) == 36
    assert len(distinct_positions(runs, tolerance=1e-7)) == 216


def test_closure_is_the_difference_at_the_repeated_position():
    angles = np.arange(37) * 10.0 - 50.0
    drift = np.linspace(0.0, 0.01, 37)
    run = ta.CalibrationRun(np.mod(angles, 360.0), angles + drift + 77.0, period=360.0)
    back = ta.CalibrationRun(angles[::-1], (angles + drift)[::-1], period=360.0)
    np.testing.assert_allclose(closure_errors([run, back]), [0.01, -0.01], atol=1e-9)
    assert closure_errors(run_at(np.arange(36) * 10.0)).size == 0
    # There and back ends where it began, but closes no turn.
    assert closure_errors(run_at([0.0, 10.0, 20.0, 10.0, 0.0])).size == 0


def test_mounts_are_a_union_of_grids():
    for first in (0.0, 3.5):  # wherever the reference has its zero
        positions = distinct_positions(
            [run_at(np.arange(36) * 10.0 + first + d) for d in (0.0, 2.14)]
        )
        assert (len(positions), positions.divisions) == (72, 36)
        assert np.allclose(np.diff(positions.offsets), 2.14 / 360.0)
        assert "2 grids of 10 deg, shifted by 0, 2.14 deg" in positions.describe()


def test_half_way_positions_are_one_finer_grid():
    positions = distinct_positions([run_at(np.arange(36) * 10.0 + d) for d in (0.0, 5.0)])
    assert (positions.divisions, len(positions.offsets)) == (72, 1)


def test_free_angles_and_part_of_a_turn_are_no_grid():
    random = np.random.default_rng(2)
    assert distinct_positions(run_at(random.uniform(0, 360, 500))).divisions is None
    arc = distinct_positions(run_at(np.arange(0.0, 188.0, 2.0)))
    assert arc.divisions is None
    assert arc.span == pytest.approx(186.0 / 360.0)


def test_a_dense_log_is_neither_one_position_nor_a_grid():
    random = np.random.default_rng(3)
    positions = distinct_positions(run_at(random.uniform(0, 360, 200_000)))
    assert positions.divisions is None
    assert 18_000 <= len(positions) <= 73_000


def test_coherence_is_one_exactly_for_the_aliases():
    positions = distinct_positions(run_at(np.arange(36) * 10.0))
    orders = np.arange(1, 405)
    coherent = orders[position_coherence(positions, 14, orders) > 1.0 - 1e-9]
    assert coherent.tolist() == [m for m in orders if fold(int(m), 36)[0] == 14]
    assert {14, 22, 50, 58, 202} <= set(coherent.tolist())


def test_coherence_by_histogram_agrees_with_the_sum():
    random = np.random.default_rng(4)
    positions = distinct_positions(run_at(random.uniform(0, 200, 6000)))
    assert len(positions) > 4096
    others = np.arange(2, 40)
    t = positions.turns
    direct = [max(abs(np.exp(2j * np.pi * (m + s) * t).mean()) for s in (5, -5)) for m in others]
    # A cell of the histogram is 1/65536 turn wide: phase error below 45 * pi / 65536.
    np.testing.assert_allclose(position_coherence(positions, 5, others), direct, atol=0.003)


def test_explanations_of_the_papers_orders():
    alias = {m: [n for n in range(1, 405) if fold(n, 36)[0] == m and n != m] for m in range(1, 18)}
    named = {m: {e.order for e in explain_order(m, alias[m], 100)} for m in alias}
    assert named[14] == {202}
    assert named[8] == {100}
    assert named[16] == {200}
    # Order 4 has a name of its own too: the third or fifth harmonic of a sensor at the output.
    assert (named[7], named[15], named[12], named[4]) == ({101}, {201}, {300}, {4, 400})
    assert str(explain_order(14, alias[14], 100)[0]) == (
        "202 (tooth mesh with the circular spline)"
    )


def test_without_a_ratio_the_common_ones_are_tried():
    alias = [n for n in range(1, 700) if fold(n, 36)[0] == 14]
    texts = [str(e) for e in explain_order(14, alias)]
    assert any("202 (" in t and "gear ratio is 100" in t for t in texts)
    assert any("50 (" in t and "gear ratio is 50" in t for t in texts)


# Equations 8 and 9 of the paper, arcsec.
JOINT_A = {1: 14.10, 4: 6.91, 8: 18.05, 12: 6.66, 14: 33.36, 15: 8.94, 16: 19.60}
JOINT_B = {1: 24.31, 4: 10.18, 7: 4.86, 8: 13.85, 12: 4.68, 14: 17.71, 16: 8.64}


@pytest.mark.parametrize(("joint", "share"), [(JOINT_A, 0.74), (JOINT_B, 0.31)])
def test_energy_near_nyquist_of_the_papers_joints(joint, share):
    # Tabulated to two digits.
    assert energy_near_nyquist(list(joint), list(joint.values()), 17) == pytest.approx(
        share, abs=0.005
    )


@pytest.mark.parametrize("wrong", [{"gear_ratio": 0.0}, {"gear_ratio": float("nan")}])
def test_bad_ratio_is_named(wrong):
    with pytest.raises(ArgumentError, match="gear_ratio"):
        gear_orders(**wrong)


def test_bad_member_is_named():
    with pytest.raises(ArgumentError, match="fixed_member"):
        gear_orders(100, "housing")


@pytest.mark.parametrize("jitter", [5.0, 20.0])
@pytest.mark.parametrize("places", [36, 48])
def test_places_met_again_not_exactly_are_the_same_places(jitter, places):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        grid = np.arange(places) * 360.0 / places
        runs = []
        for label in "abcd":
            theta = grid + rng.uniform(-jitter, jitter, places) / 3600.0
            error = 0.05 * np.sin(np.radians(theta)) + rng.normal(0.0, 2e-3, places)
            runs.append(ta.CalibrationRun(theta, theta + error, 360.0, label=label))
        found = distinct_positions(runs)
        assert (len(found), found.divisions) == (places, places), seed
        assert verified_positions(runs).count == places
        assert ta.select_orders(runs).to_dict()["distinct_positions"] == places


def test_two_mounts_near_to_each_other_stay_two():
    theta = np.concatenate([np.arange(36) * 10.0, np.arange(36) * 10.0 + 0.05])
    assert len(distinct_positions(ta.CalibrationRun(theta, theta, 360.0))) == 72


@pytest.mark.parametrize(("runs", "places"), [(16, 185), (8, 370), (1, 2960), (60, 41)])
def test_free_places_leave_no_alias_in_question(runs, places):
    rng = np.random.default_rng(29)
    found = []
    for k in range(runs):
        even = np.arange(places) * 360.0 / places + rng.uniform(0.0, 360.0 / places)
        theta = even if runs > 1 else np.sort(rng.uniform(0.0, 360.0, places))
        error = 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 1e-3, places)
        found.append(ta.CalibrationRun(theta, theta + error, 360.0, label=str(k)))
    assert verified_positions(found).between
    assert "verified only" not in (ta.fit(found).model.fit.note or "")


def test_one_grid_and_few_places_leave_aliases():
    grid = np.tile(np.arange(36) * 10.0, 3)
    few = np.random.default_rng(3).uniform(0.0, 360.0, 9)
    for theta in (grid, few):
        assert not verified_positions(ta.CalibrationRun(theta, theta, 360.0)).between


@pytest.mark.parametrize("n", [5, 36, 37])
@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_orders_are_alike_where_their_cosines_are(n, shift):
    """Slow: columns of both phases at the positions, one against the other."""
    turns = (np.arange(n) + shift) / n
    found = distinct_positions(ta.CalibrationRun(turns, turns, period=1.0))
    assert (len(found), found.divisions, found.highest_order) == (n, n, (n - 1) // 2)
    others = np.arange(0.0, 3.0 * n)
    for order in (1.0, 3.0, n + 2.0, 2.5):
        wave = np.exp(2j * np.pi * order * found.turns)
        slow = [
            max(
                abs(np.mean(wave * np.exp(-2j * np.pi * m * found.turns))),
                abs(np.mean(wave * np.exp(2j * np.pi * m * found.turns))),
            )
            for m in others
        ]
        np.testing.assert_allclose(position_coherence(found, order, others), slow, atol=1e-9)
    spectrum = [abs(np.exp(2j * np.pi * m * found.turns).mean()) for m in range(2 * n + 1)]
    np.testing.assert_allclose(found.spectrum(2 * n), spectrum, atol=1e-9)
    rows = np.array([3, 0, 3])
    np.testing.assert_array_equal(found.of_rows(rows).index, found.index[rows])


def test_positions_in_words_and_their_span():
    def described(turns):
        turns = np.asarray(turns)
        found = distinct_positions(ta.CalibrationRun(turns, turns, period=1.0))
        return found.describe(), found.span

    assert described([0.25]) == ("1 distinct position", 1.0)
    assert described([0.25, 0.75]) == ("2 distinct positions", 1.0)  # two make no grid
    assert described([0.25, 7.0 / 12.0, 11.0 / 12.0])[0] == "3 distinct positions, 120 deg apart"
    assert described(np.arange(36) / 36.0) == ("36 distinct positions, 10 deg apart", 1.0)
    two = np.concatenate([np.arange(12) / 12.0, np.arange(12) / 12.0 + 0.01])
    assert described(two)[0] == "24 distinct positions: 2 grids of 30 deg, shifted by 0, 3.6 deg"
    arc, span = described(np.linspace(0.0, 0.5, 40))
    assert arc == "40 distinct positions over 180 deg"
    assert span == pytest.approx(0.5)
    # A gap of 20 degrees, or of three usual ones, is no missing travel.
    for gap, whole in ((19.9, True), (20.1, False)):
        assert (described(np.linspace(0.0, 1.0 - gap / 360.0, 200))[1] == 1.0) == whole
    for gaps, whole in ((2.99, True), (3.01, False)):
        assert (described(np.linspace(0.0, 9.0, 10) / (9.0 + gaps))[1] == 1.0) == whole


def test_the_share_of_energy_near_the_end():
    assert energy_near_nyquist([1, 2, 3, 4], [1.0, 2.0, 3.0, 4.0], 4) == pytest.approx(25 / 30)
    assert energy_near_nyquist([1, 2, 3], [1.0, 2.0, 3.0], 3) == pytest.approx(13 / 14)
    assert energy_near_nyquist([1], [0.0], 3) == 0.0


@pytest.mark.parametrize("turn", [360.0, 2.0 * np.pi, 1.0, 8192.0])
def test_a_turn_that_closes_from_both_sides_of_its_tolerance(turn):
    slip, unit = np.array([0.0, 0.0, 0.0, 0.25 * turn / 360.0]), turn / 360.0
    for off, closes in ((0.009, True), (0.011, False)):
        reference = np.array([0.0, 120.0, 240.0, 360.0 + off]) * unit
        run = ta.CalibrationRun(reference, reference + slip, turn)
        assert closure_errors(run).tolist() == (pytest.approx([slip[-1]]) if closes else [])
        back = ta.CalibrationRun(-reference, -reference + slip, turn)
        assert closure_errors(back).tolist() == (pytest.approx([slip[-1]]) if closes else [])
    wide = closure_errors(run, tolerance=0.02 * unit)
    assert wide == pytest.approx([slip[-1]])
    assert closure_errors(ta.CalibrationRun([0.0, turn], [0.0, turn], turn)).size == 0
    half = np.array([0.0, 90.0, 180.0]) * unit
    assert closure_errors(ta.CalibrationRun(half, half, turn)).size == 0


@pytest.mark.parametrize("unit", [360.0, 1.0, 2.0 * np.pi])
def test_a_tolerance_is_above_nothing_and_below_half_a_turn(unit):
    run = run_at(np.array([0.0, 0.2, 0.6]) * unit, unit)
    for wrong in (0.0, -1e-3 * unit, 0.5 * unit, np.nan):
        with pytest.raises(ArgumentError, match="between 0 and half a turn"):
            distinct_positions(run, tolerance=wrong)
    assert len(distinct_positions(run, tolerance=0.19 * unit)) == 3
    assert len(distinct_positions(run, tolerance=0.21 * unit)) == 2


def test_positions_lie_in_a_turn_however_they_are_rounded():
    """Just below nothing is nothing, no whole turn: one place with those that are."""
    for just_below in (-1e-17, -1e-14, 360.0 - 1e-13, 720.0):
        found = distinct_positions(run_at([just_below, 90.0, 180.0, 270.0]))
        assert found.turns[0] == 0.0
        assert found.turns.max() < 1.0
        np.testing.assert_allclose(found.turns[found.index], [0.0, 0.25, 0.5, 0.75], atol=1e-9)


@pytest.mark.parametrize(("width", "clear", "merged"), [
    (0.020, 5.1, True), (0.020, 4.9, False), (0.027, 9.0, True), (0.029, 9.0, False),
])  # fmt: skip
def test_places_that_stand_clear_are_met_again_within_what_an_order_tells(width, clear, merged):
    """Five times as far apart as each is wide, up to 0.2 radians of order 404: 0.0284 degrees."""
    first = 40.0 + np.arange(8) * width * (1.0 + clear)
    found = distinct_positions(run_at(np.concatenate([first, first + width])))
    assert len(found) == (8 if merged else 16)
