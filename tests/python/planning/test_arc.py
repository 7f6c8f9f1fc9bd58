"""Places on an arc: optimal by the equivalence theorem, by explicit solutions, and as told."""

import json
import math
import secrets

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.cli.values import angle as typed_angle
from trueangle.errors import ArgumentError
from trueangle.planning.doptimal import OrthonormalColumns, d_optimal, rounded
from trueangle.planning.noisefactors import noise_factors

SEED = 32_700

#: The published figures have three digits, and dense spacing stood for a fine grid.
PRINTED = 1.5e-3

#: Places are found to this, in degrees: the determinant is flat where it is largest.
PLACE = 1e-4


def design(x, orders):
    columns = [np.ones_like(x)]
    for k in orders:
        columns += [np.cos(k * x), np.sin(k * x)]
    return np.column_stack(columns)


def efficiency(places, counts, orders, optimum):
    """By plain determinants of plain columns, to 1 over the coefficients."""

    def information(degrees, shares):
        rows = design(np.radians(degrees), orders)
        return rows.T @ (np.asarray(shares)[:, None] * rows)

    counts = np.asarray(counts, dtype=float)
    own = np.linalg.slogdet(information(np.asarray(places), counts / counts.sum()))[1]
    best = np.linalg.slogdet(information(*optimum))[1]
    return math.exp((own - best) / (1 + 2 * len(orders)))


@pytest.mark.parametrize(
    ("orders", "arc"),
    [([1], 170), ([1, 2], 180), ([1, 2, 3, 4], 270), (range(1, 9), 300), ([1, 2, 3], 60)],
)
def test_no_place_has_more_variance_than_the_equivalence_theorem_allows(orders, arc):
    """Kiefer and Wolfowitz: at most p everywhere, p at every place of the design."""
    orders = list(orders)
    columns = OrthonormalColumns(orders, 0.1, 0.1 + arc / 360.0)
    found = d_optimal(columns)
    x = 2.0 * np.pi * (0.1 + np.linspace(0.0, arc / 360.0, 7001))
    rows, own = design(x, orders), design(2.0 * np.pi * found.places, orders)
    scale = np.linalg.qr(rows)[1]  # plain columns are hardly told apart over short arcs
    rows, own = np.linalg.solve(scale.T, rows.T).T, np.linalg.solve(scale.T, own.T).T
    inverse = np.linalg.inv(own.T @ (found.weights[:, None] * own))
    p = 1 + 2 * len(orders)
    assert np.einsum("ij,jk,ik->i", rows, inverse, rows).max() <= p * (1.0 + 1e-6)
    np.testing.assert_allclose(np.einsum("ij,jk,ik->i", own, inverse, own), p, rtol=1e-6)
    assert found.excess == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("orders", "arc"), [([2], 180), ([2, 5], 170), ([1, 17], 60), ([1, 101, 202], 340)]
)
def test_weight_that_stays_spread_is_told_as_it_is(orders, arc):
    """Of gaps between the orders: many places; even ones, a seventh of a turn apart, may fail."""
    found = d_optimal(OrthonormalColumns(orders, 0.0, arc / 360.0))
    x = 2.0 * np.pi * np.linspace(0.0, arc / 360.0, 9001)
    own = design(2.0 * np.pi * found.places, orders)
    information = own.T @ (found.weights[:, None] * own)
    p = 1 + 2 * len(orders)

    def variances(rows):
        return np.einsum("ij,ij->i", rows @ np.linalg.inv(information), rows)

    assert found.places.size > p
    assert np.diff(found.places).min() > 0.0
    assert found.weights.min() > 0.0
    assert found.weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.excess < 1e-3
    assert variances(design(x, orders)).max() / p - 1.0 == pytest.approx(found.excess, abs=1e-4)
    assert found.log_det == pytest.approx(np.linalg.slogdet(information)[1], abs=1e-9)


@pytest.mark.parametrize("half", [30.0, 60.0, 90.0, 110.0])
def test_explicit_solutions_on_a_partial_circle(half):
    """Orders 1: ends and middle; 1 and 2: of 4c^2 + (1 - 2A)c - (A + 2) = 0, A = cos of the end.

    The determinant of all orders up to m is a product of sines of half the distances (Dette,
    Melas and Pepelyshev 2002).
    """
    one = d_optimal(OrthonormalColumns([1], -half / 360.0, half / 360.0))
    np.testing.assert_allclose(360.0 * one.places, [-half, 0.0, half], atol=PLACE)
    end = math.cos(math.radians(half))
    b = 1.0 - 2.0 * end
    inner = math.degrees(math.acos((-b + math.sqrt(b * b + 16.0 * (end + 2.0))) / 8.0))
    two = d_optimal(OrthonormalColumns([1, 2], -half / 360.0, half / 360.0))
    np.testing.assert_allclose(360.0 * two.places, [-half, -inner, 0.0, inner, half], atol=PLACE)
    np.testing.assert_allclose(two.weights, 0.2, rtol=1e-9)


def test_long_arcs_need_no_more_than_even_places():
    """From 2m of 2m + 1 steps of a turn on, even places are as good as over the turn."""
    orders, stop = [1, 2, 3, 4], 8.0 / 9.0
    found = d_optimal(OrthonormalColumns(orders, 0.0, stop))
    even = 40.0 * np.arange(9)
    optimum = (even, np.full(9, 1.0 / 9.0))
    assert efficiency(360.0 * found.places, found.weights, orders, optimum) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("orders", "arc", "dense", "even", "least", "worse"),
    [
        ([1, 2, 3, 4], 270.0, 0.805, 0.848, 0.99, (1.99, 1.71)),
        ([1, 2], 180.0, 0.684, 0.717, 0.99, (1.73, 1.62)),
        (list(range(1, 9)), 300.0, None, None, 0.985, None),
    ],
)
def test_published_efficiencies(orders, arc, dense, even, least, worse):
    plan = ta.plan_arc(0.0, arc, orders, readings=60)
    found = d_optimal(OrthonormalColumns(orders, 0.0, arc / 360.0))
    optimum = (360.0 * found.places, found.weights)
    assert plan.readings == 60
    assert plan.d_efficiency >= least
    own = efficiency(plan.places_deg, plan.counts, orders, optimum)
    assert plan.d_efficiency == pytest.approx(own, rel=1e-6)
    if dense is not None:
        assert plan.efficiency_of_even_spacing == pytest.approx(even, abs=PRINTED)
        x = np.linspace(0.0, arc, 200_001)
        assert efficiency(x, np.ones(x.size), orders, optimum) == pytest.approx(dense, abs=PRINTED)
    # The worst coefficient is hardly worse than with shares that need not be whole readings.
    shares = np.repeat(found.places, 1000)
    continuous = noise_factors(shares, orders).max()
    assert plan.worst_noise_factor <= 1.02 * continuous
    if worse is not None:
        ratio = max(plan.even_noise_factors.values()) / continuous
        assert ratio == pytest.approx(worse[1], rel=0.02)


def test_readings_are_shared_out_with_the_least_loss():
    """By trying all: no other shares of 14 readings over 5 places have a larger determinant."""
    found = d_optimal(OrthonormalColumns([1, 2], 0.0, 0.5))
    counts = rounded(found.weights, 14)
    assert sorted(counts.tolist()) == [2, 3, 3, 3, 3]
    assert rounded(np.array([0.6, 0.3, 0.1]), 10).tolist() == [6, 3, 1]


@pytest.mark.parametrize("halves", [1, 2])
@pytest.mark.parametrize("ratio", [4, 5, 6])
def test_rounding_asks_for_no_further_readings(ratio, halves):
    """Nine coefficients at nine places, ``n`` readings each: k s / sqrt(n) is reached exactly."""
    plan = ta.plan_arc(0.0, 270.0, [1, 2, 3, 4], noise=float(ratio), uncertainty=2.0 / halves)
    assert plan.readings == 9 * (ratio * halves) ** 2


@pytest.mark.parametrize(("runs", "both"), [(1, False), (3, False), (2, True)])
def test_the_uncertainty_is_the_one_that_fits_get(runs, both):
    """The scatter of fitted curves over the arc, zeros of runs known to none."""
    rng = np.random.default_rng(SEED + runs)
    print(f"seed {SEED + runs}")
    sigma, orders = 4.0, [1, 2, 3]
    plan = ta.plan_arc(-100.0, 130.0, orders, noise=sigma, uncertainty=3.0, runs=runs,
                       both_directions=both)  # fmt: skip
    assert plan.uncertainty_arcsec <= 3.0 * (1.0 + 1e-9)
    x = np.radians(np.repeat(plan.places_deg, plan.counts))
    if both:
        assert all(count % 2 == 0 for count in plan.counts)
    rows = design(np.tile(x, runs), orders)
    solve = np.linalg.pinv(rows)
    arc = design(np.radians(np.linspace(-100.0, 130.0, 231)), orders)
    curves = arc @ (solve @ (sigma * rng.standard_normal((x.size * runs, 400))))
    got = 2.0 * np.sqrt(np.mean(curves**2, axis=1)).max()
    # 400 deviations: 3.5 % each, and the largest of some thirty independent ones.
    assert 0.95 < got / plan.uncertainty_arcsec < 1.1
    # A reading less at every place would not do.
    less = plan.readings - len(plan.places_deg) * runs * (2 if both else 1)
    fewer = ta.plan_arc(-100.0, 130.0, orders, noise=sigma, readings=less, runs=runs,
                        both_directions=both)  # fmt: skip
    assert fewer.uncertainty_arcsec > 3.0


def test_places_stand_apart():
    plan = ta.plan_arc(0.0, 270.0, [1, 2], readings=40, apart=1.5)
    assert set(plan.counts) == {1}
    assert min(np.diff(plan.places_deg)) >= 1.5 - 1e-5
    assert plan.places_deg[0] >= 0.0
    assert plan.places_deg[-1] <= 270.0
    assert 0.9 < plan.d_efficiency < 1.0
    with pytest.raises(ArgumentError, match="cannot be 10 deg apart"):
        ta.plan_arc(0.0, 270.0, [1, 2], readings=40, apart=10.0)


def test_what_an_arc_does_not_tell_is_said_before():
    usual = ta.plan_arc(0.0, 60.0)
    assert usual.orders == (1.0,)
    assert "orders up to 1" in usual.notes[0]
    asked = ta.plan_arc(0.0, 60.0, [1, 2])
    assert "more than 1000 times" in asked.notes[0]
    with pytest.raises(ArgumentError, match="look the same over 10 deg"):
        ta.plan_arc(0.0, 10.0, range(1, 9))


def test_even_places_that_do_not_tell_the_orders_are_no_end_of_a_plan():
    """Orders 1, 101 and 202 at sevenths of a turn, 101 and 202 being 3 and -1 there."""
    plan = ta.plan_arc(0.0, 340.0, [1, 101, 202], readings=60)
    assert sum(plan.counts) == 60
    assert 0.999 < plan.d_efficiency <= 1.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"start": 10.0, "stop": 10.0}, "an arc runs from"),
        ({"start": 0.0, "stop": 400.0}, "at most 360 deg"),
        ({"start": 0.0, "stop": 90.0, "orders": [1, 1]}, "each named once"),
        ({"start": 0.0, "stop": 270.0, "readings": 5}, "readings must be at least 10"),
        ({"start": 0.0, "stop": 270.0, "uncertainty": 2.0}, "give `noise=`"),
        (
            {"start": 0.0, "stop": 270.0, "uncertainty": -2.0, "noise": 1.0},
            "uncertainty must be positive",
        ),
        ({"start": 0.0, "stop": 270.0, "runs": 0}, "runs must be"),
    ],
)  # fmt: skip
def test_what_cannot_be_planned(given, told):
    with pytest.raises(ArgumentError, match=told):
        ta.plan_arc(**given)


def test_the_command(capsys):
    assert main(["plan", "--arc=-135:135", "--orders", "1-4", "--readings", "60", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    plan = ta.plan_arc(-135.0, 135.0, [1, 2, 3, 4], readings=60)
    assert found["places_deg"] == pytest.approx(list(plan.places_deg))
    assert found["counts"] == list(plan.counts)
    assert found["d_efficiency"] == pytest.approx(plan.d_efficiency)
    assert found["noise_factors"]["1"] == pytest.approx(plan.noise_factors[1.0])
    text = ["plan", "--arc", "0:180", "--uncertainty", "0.001deg", "--noise-arcsec", "5"]
    assert main(text) == 0
    told = capsys.readouterr().out
    assert "place/deg  readings" in told
    assert "arcsec at the worst place" in told
    for wrong, why in (
        (["--arc", "90"], "is not an arc"),
        (["--uncertainty", "x"], "is not an angle"),
    ):
        with pytest.raises(SystemExit):
            main(["plan", *wrong])
        assert why in capsys.readouterr().err
    assert main(["plan", "--readings", "60"]) == 1
    assert "add --arc START:STOP" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["1deg", "60arcmin", "3600arcsec", "3600", f"{1000.0 * math.radians(1.0)!r}mrad"]
)
def test_a_wanted_uncertainty_is_the_same_in_every_unit(text):
    assert typed_angle(text) == pytest.approx(3600.0, rel=1e-12)


@pytest.mark.parametrize(
    ("runs", "both", "asked", "made"),
    [(1, False, 61, 61), (2, False, 61, 62), (1, True, 61, 62), (2, True, 61, 64),
     (3, True, 60, 60)],
)  # fmt: skip
def test_no_fewer_readings_than_asked_for_and_as_many_in_each_run_and_direction(
    runs: int, both: bool, asked: int, made: int
) -> None:
    plan = ta.plan_arc(0.0, 200.0, [1, 2], readings=asked, runs=runs, both_directions=both)
    assert plan.readings == runs * sum(plan.counts) == made


@pytest.mark.parametrize(("runs", "both", "least"), [(1, False, 6), (3, False, 15), (3, True, 30)])
def test_a_run_has_a_reading_for_each_coefficient_in_each_direction(
    runs: int, both: bool, least: int
) -> None:
    """And one more than there are unknowns, of which a fit has its residual."""

    def plan(readings: int) -> ta.planning.ArcPlan:
        return ta.plan_arc(0.0, 200.0, [1, 2], readings=readings, runs=runs, both_directions=both)

    assert plan(least).readings == least
    short = least - (6 if both else runs)
    told = rf"readings must be at least {least} for 2 orders, got {short}$"
    with pytest.raises(ArgumentError, match=told):
        plan(short)


@pytest.mark.parametrize("runs", [1, 4])
@pytest.mark.parametrize(("orders", "arc"), [([1, 2], 150.0), ([1, 2, 3], 300.0)])
def test_the_worst_coefficient_has_the_standard_error_that_is_asked_for(
    orders: list[int], arc: float, runs: int
) -> None:
    """By the normal equations of the places; a twentieth fewer would not do."""
    noise, wanted = 3.0, 0.5
    plan = ta.plan_arc(20.0, 20.0 + arc, orders, noise=noise, standard_error=wanted, runs=runs)
    rows = design(np.radians(np.repeat(plan.places_deg, runs * np.array(plan.counts))), orders)
    variances = np.diag(np.linalg.inv(rows.T @ rows))[1:].reshape(-1, 2)
    worst = noise * np.sqrt(variances.max())
    # Of the larger axis of the two coefficients of an order, whose ellipse may be turned.
    assert worst <= wanted * 1.02
    assert worst > 0.6 * wanted
    assert plan.worst_noise_factor * noise * np.sqrt(2.0 / plan.readings) == pytest.approx(
        wanted, rel=0.05
    )


def test_a_million_readings_are_planned_and_no_more() -> None:
    """Three coefficients: 3 (k s / u)^2."""
    noise = 1.0
    for readings, fits in ((999_999, True), (1_000_002, False)):
        uncertainty = 2.0 * noise * np.sqrt(3.0 / readings) * (1.0 + 1e-12)
        if fits:
            plan = ta.plan_arc(0.0, 180.0, [1], noise=noise, uncertainty=uncertainty)
            assert plan.readings == readings
        else:
            with pytest.raises(ArgumentError, match="more than 1000000 readings"):
                ta.plan_arc(0.0, 180.0, [1], noise=noise, uncertainty=uncertainty)


def test_an_arc_may_be_a_whole_turn() -> None:
    assert ta.plan_arc(-90.0, 270.0, [1]).d_efficiency == pytest.approx(1.0)
    for start, stop in ((-90.0, 270.1), (5.0, 5.0), (5.0, 4.0)):
        with pytest.raises(ArgumentError, match="an arc runs from"):
            ta.plan_arc(start, stop, [1])


def test_readings_apart_stay_around_their_places_and_may_fill_the_arc() -> None:
    plan = ta.plan_arc(0.0, 180.0, [1], readings=15, apart=2.0)
    places = np.array(plan.places_deg).reshape(3, 5)
    np.testing.assert_allclose(
        places - [[0.0], [86.0], [172.0]], np.arange(5) * 2.0 * np.ones((3, 1))
    )
    full = ta.plan_arc(0.0, 180.0, [1], readings=13, apart=15.0)
    np.testing.assert_allclose(full.places_deg, np.arange(13) * 15.0, atol=1e-5)
    with pytest.raises(ArgumentError, match=r"13 places cannot be 15\.1 deg apart on 180 deg"):
        ta.plan_arc(0.0, 180.0, [1], readings=13, apart=15.1)


@pytest.mark.parametrize("arc", [60.0, 150.0])
def test_usual_orders_that_an_arc_does_not_tell_are_left_out_and_said(arc: float) -> None:
    plan = ta.plan_arc(0.0, arc)
    assert plan.orders == tuple(range(1, len(plan.orders) + 1))
    assert f"orders up to {max(plan.orders):g}: over {arc:g} deg" in plan.notes[0]
    with_one_more = ta.plan_arc(0.0, arc, [*plan.orders, len(plan.orders) + 1])
    assert "more than 1000 times" in with_one_more.notes[0]


# The rms over J joints with p coefficients each has a relative deviation of 1 / sqrt(2 J p): 0.9 %.
# A plan of whole readings promises up to a part of one reading in 75 too little, another 0.7 %.
COEFFICIENTS, NOISE, WANTED = 6_000, 5.0, 2.0


@pytest.mark.parametrize(
    ("arc", "orders"),
    [((0.0, 360.0), [1, 2, 3, 4]), ((-135.0, 135.0), [1, 2, 3]), ((0.0, 180.0), [1])],
)
def test_as_many_joints_are_as_uncertain_as_promised(arc, orders):
    """At the places, where the variance is the largest: p / N of that of a reading."""
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    plan = ta.plan_arc(*arc, orders, noise=NOISE, uncertainty=WANTED)
    assert plan.uncertainty_arcsec <= WANTED * (1.0 + 1e-9)
    places = np.array(plan.places_deg)
    x = np.repeat(places, plan.counts)

    def columns(degrees):
        lines = [wave(np.radians(k * degrees)) for k in orders for wave in (np.cos, np.sin)]
        return np.column_stack([np.ones_like(degrees), *lines])

    wrong = []
    for _ in range(COEFFICIENTS // (1 + 2 * len(orders))):
        truth = rng.normal(0.0, 30.0, 1 + 2 * len(orders))
        error = columns(x) @ truth + NOISE * rng.standard_normal(x.size)
        run = ta.CalibrationRun(x, x + error / 3600.0, period=360.0)
        model = ta.fit([run], orders=orders, covariance="white", argument="reference").model
        wrong.append(3600.0 * model.error(places) - columns(places) @ truth)
    got = 2.0 * float(np.sqrt(np.mean(np.square(wrong))))
    assert 0.95 < plan.uncertainty_arcsec / got < 1.05


def test_without_an_arc_the_whole_turn_is_meant(capsys):
    asked = ["plan", "--orders", "1-4", "--noise-arcsec", "5", "--uncertainty", "2arcsec"]
    assert main([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["start_deg"], told["stop_deg"]) == (0.0, 360.0)
    assert told["uncertainty_arcsec"] <= WANTED * (1.0 + 1e-9)
    # Nine coefficients, each with its share of the readings: 9 (2 * 5 / 2)^2 = 225.
    assert told["readings"] == 225
