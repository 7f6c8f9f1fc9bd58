"""How few readings a unit of a fleet needs: what is promised is what such units get."""

import json
import secrets
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, KindError
from trueangle.fitting.prior import Prior
from trueangle.fleets import plan_unit
from trueangle.joint.shafts import ShaftOrders
from trueangle.planning import plan_arc

#: From unit to unit, arcsec: order 1 by 30, the higher ones by ever less.
SPREAD = {1: 30.0, 2: 8.0, 3: 2.0, 4: 0.5}
MEAN = {1: (40.0, 10.0), 2: (20.0, -5.0), 3: (0.0, 0.0), 4: (8.0, 3.0)}
NOISE, UNITS = 3.0, 200

#: Standard errors within which what is got must be what was promised, and that of their ratio at
#: most: 200 units of a few coefficients each tell it to 2.5 %. The mean of their squares is skew by
#: 0.1, so that 5 standard errors are exceeded by chance three times in a million.
SCATTER, SHARP = 5.0, 0.025

PRIOR = Prior(
    360.0,
    (ShaftOrders("output", 1.0, tuple(SPREAD)),),
    np.array([value for pair in MEAN.values() for value in pair]) / 3600.0,
    np.repeat([(s / 3600.0) ** 2 for s in SPREAD.values()], 2),
    np.inf,
    (NOISE / 3600.0) ** 2,
    np.inf,
    1000,
)


def columns(degrees):
    lines = [wave(np.radians(k * degrees)) for k in SPREAD for wave in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(degrees), *lines])


@pytest.mark.parametrize(
    ("arc", "wanted"),
    [((0.0, 360.0), 6.0), ((0.0, 360.0), 2.0), ((-135.0, 135.0), 5.0), ((0.0, 180.0), 8.0)],
)
def test_units_of_the_fleet_are_as_uncertain_as_promised(arc, wanted):
    """At the place that is the worst, over units that are drawn as the prior says."""
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    plan = plan_unit(PRIOR, *arc, uncertainty=wanted)
    assert plan.uncertainty_arcsec <= wanted
    x = np.repeat(np.array(plan.places_deg), plan.counts)
    grid = np.linspace(*arc, 721)
    mean, spread = PRIOR.mean * 3600.0, np.sqrt(PRIOR.variance) * 3600.0
    wrong = []
    for _ in range(UNITS):
        own = np.concatenate([rng.normal(0.0, 20.0, 1), mean + spread * rng.standard_normal(8)])
        error = columns(x) @ own + NOISE * rng.standard_normal(x.size)
        run = ta.CalibrationRun(x, x + error / 3600.0, period=360.0)
        model = ta.fit([run], prior=PRIOR, loss="linear").model
        wrong.append(3600.0 * model.error(grid) - columns(grid) @ own)
    covariance = known_covariance(x)
    variances = np.einsum("ij,jk,ik->i", columns(grid), covariance, columns(grid))
    assert 2.0 * np.sqrt(variances.max()) == pytest.approx(plan.uncertainty_arcsec, rel=1e-3)
    got = float(np.mean(np.square(wrong) / variances))
    # The mean over the arc is a form of the coefficients, with twice its squared trace as variance.
    weighted = columns(grid).T @ (columns(grid) / variances[:, None]) / grid.size
    form = covariance @ weighted
    error = float(np.sqrt(2.0 * np.trace(form @ form) / UNITS))
    print("promised/got", got**-0.5, "to", 0.5 * error, plan.readings, plan.readings_without)
    assert abs(got - 1.0) < SCATTER * error
    assert 0.5 * error < SHARP


def known_covariance(x):
    """Of the zero and all coefficients, by dense matrices; the zero is free."""
    precision = np.diag(np.concatenate([[0.0], 1.0 / (PRIOR.variance * 3600.0**2)]))
    return np.linalg.inv(columns(x).T @ columns(x) / NOISE**2 + precision)


def test_a_fleet_spares_readings_and_never_costs_any():
    for wanted in (10.0, 5.0, 2.0, 1.0):
        plan = plan_unit(PRIOR, uncertainty=wanted)
        plain = plan_arc(0.0, 360.0, SPREAD, noise=NOISE, uncertainty=plan.uncertainty_arcsec)
        assert plan.readings_without == plain.readings
        assert plan.readings <= plain.readings
    assert plan_unit(PRIOR, uncertainty=10.0).readings < 9  # coefficients with the zero


def test_the_unit_s_own_share_is_what_its_readings_take_away():
    plan = plan_unit(PRIOR, readings=12)
    left = np.diag(known_covariance(np.repeat(plan.places_deg, plan.counts)))[1:].reshape(-1, 2)
    variance = np.array([s**2 for s in SPREAD.values()])[:, None]
    expected = (1.0 - left / variance).mean(axis=1)
    assert [*plan.own.values()] == pytest.approx(expected.tolist(), abs=1e-6)
    assert [*plan.std_arcsec.values()] == pytest.approx(np.sqrt(left.mean(axis=1)).tolist())
    assert plan.readings == 12


def test_no_readings_are_better_placed_by_chance():
    """The planned places against the best of many at random."""
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    plan = plan_unit(PRIOR, -135.0, 135.0, readings=9)
    grid = columns(np.linspace(-135.0, 135.0, 361))
    for _ in range(300):
        x = rng.uniform(-135.0, 135.0, 9)
        worst = 2.0 * np.sqrt(np.einsum("ij,jk,ik->i", grid, known_covariance(x), grid).max())
        assert worst > 0.99 * plan.uncertainty_arcsec


def test_an_order_that_the_fleet_does_not_know_is_free_and_one_that_never_varies_is_known():
    more = plan_unit(PRIOR, orders=[1, 2, 3, 4, 7], readings=20)
    assert more.own[7.0] == pytest.approx(1.0)
    still = replace(PRIOR, variance=np.where(np.arange(8) < 2, PRIOR.variance, 0.0))
    plan = plan_unit(still, readings=3)
    assert plan.std_arcsec[4.0] < 1e-3
    assert plan.own[4.0] == pytest.approx(0.0, abs=1e-6)


WRONG = {
    "neither": ({}, "give either `uncertainty=`"),
    "both": ({"uncertainty": 2.0, "readings": 3}, "give either `uncertainty=`"),
    "negative": ({"uncertainty": -2.0}, "uncertainty must be positive"),
    "none": ({"readings": 0}, "readings must be a whole number"),
    "noise": ({"readings": 3, "noise": 0.0}, "noise must be positive"),
    "orders": ({"readings": 3, "orders": [1, 1]}, "orders must be positive and each named once"),
    "arc": ({"readings": 3, "start": 10.0, "stop": 10.0}, "an arc runs from"),
    "too fine": ({"uncertainty": 1e-3}, "takes more than 100000 readings"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_planned_is_refused(what):
    options, said = WRONG[what]
    with pytest.raises(ArgumentError, match=said):
        plan_unit(PRIOR, **options)


def test_a_prior_is_of_a_fleet():
    with pytest.raises(KindError, match=r"prior must be a trueangle\.Fleet"):
        plan_unit("fleet.json", readings=3)


@pytest.fixture(scope="module")
def fleet_file(tmp_path_factory):
    rng = np.random.default_rng(3)
    places = np.arange(60) * 6.0
    runs = []
    for unit in range(12):
        own = [0.0, *(3600.0 * PRIOR.mean + 3600.0 * np.sqrt(PRIOR.variance) * rng.normal(size=8))]
        for run in range(2):
            error = (columns(places) @ own + NOISE * rng.standard_normal(60)) / 3600.0
            runs.append(
                ta.CalibrationRun(places, places + error, 360.0, unit=f"u{unit}", label=f"{run}")
            )
    path = tmp_path_factory.mktemp("fleet") / "fleet.json"
    ta.fleet(runs, orders=list(SPREAD)).save(path)
    return path


def test_the_command_prints_the_plan(fleet_file, capsys):
    asked = ["plan", "--prior", str(fleet_file), "--uncertainty", "6arcsec"]
    assert main([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "unit"
    assert told["uncertainty_arcsec"] <= 6.0
    assert told["readings"] == sum(told["counts"])
    assert told["units"] == 12
    assert main([*asked, "--arc", "0:180"]) == 0
    text = capsys.readouterr().out
    assert "of a unit like the 12 of the fleet" in " ".join(text.split())
    assert main(["plan", "--prior", str(fleet_file)]) == 1
    assert "--uncertainty 2arcsec" in capsys.readouterr().err
    assert main([*asked, "--apart", "2"]) == 1
    assert "--apart does not go with --prior" in capsys.readouterr().err


def test_what_runs_of_one_unit_differ_by_is_told():
    """The largest of any coefficient; of a fleet whose runs do not differ nothing is."""
    apart = np.array([0.4, 0.4, 1.5, 1.5, 0.0, 0.0, 0.2, 0.2]) / 3600.0
    plan, plain = (
        plan_unit(replace(PRIOR, run_variance=known), 0.0, 360.0, readings=12)
        for known in (apart**2, None)
    )
    (note,) = set(plan.notes) - set(plain.notes)
    assert "differ by 1.5 arcsec" in note
    assert plan.places_deg == plain.places_deg
