"""The uncertainty that a plan promises is the one that calibrations by it have."""

import json
import secrets

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

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
