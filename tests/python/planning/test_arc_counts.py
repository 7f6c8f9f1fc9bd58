"""Readings of a plan on an arc: how many, where within a group, and what is refused."""

from __future__ import annotations

import json
import secrets

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError

from .test_arc import design


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


@pytest.mark.parametrize(("runs", "both", "least"), [(1, False, 5), (3, False, 15), (3, True, 30)])
def test_a_run_has_a_reading_for_each_coefficient_in_each_direction(
    runs: int, both: bool, least: int
) -> None:
    def plan(readings: int) -> ta.planning.ArcPlan:
        return ta.plan_arc(0.0, 200.0, [1, 2], readings=readings, runs=runs, both_directions=both)

    assert plan(least).readings == least
    short = least - (6 if both else runs)
    told = rf"readings must be at least {least} for 2 orders .*, got {short}$"
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
