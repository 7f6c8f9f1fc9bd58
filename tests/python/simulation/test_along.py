"""A simulated joint along the motion of runs that there are."""

import secrets
from dataclasses import replace

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.simulation import (
    Backlash,
    Harmonic,
    RunDesign,
    Simulation,
    simulate,
    simulate_along,
)

SIM = Simulation(
    harmonics=(Harmonic("output", 3, 20.0, 10.0),),
    effects=(Backlash(5.0),),
    runs=(RunDesign("a", reversals=(0.5,), samples=400), RunDesign("b", samples=300)),
)


def test_without_noise_it_is_what_the_runs_of_the_simulation_read():
    own = simulate(SIM, 4)
    again = simulate_along(SIM, own)
    for one, other in zip(own, again, strict=True):
        np.testing.assert_allclose(one.indicated, other.indicated, rtol=0, atol=1e-9)
        assert one.label == other.label


def test_angles_keep_their_unit():

    turns = [
        replace(
            run,
            reference=run.reference / 360.0,
            indicated=run.indicated / 360.0,
            period=1.0,
            velocity=run.velocity / 360.0,
            mount=None,
        )
        for run in simulate(SIM, 4)
    ]
    read = simulate_along(SIM, turns)[0]
    np.testing.assert_allclose(read.indicated * 360.0, simulate(SIM, 4)[0].indicated, atol=1e-9)


def test_noise_is_correlated_within_runs_and_has_its_deviation():
    seed = secrets.randbits(32)
    print("seed", seed)
    long = Simulation(sigma_arcsec=3.0, runs=(RunDesign(samples=40_000), RunDesign(samples=9)))
    error = simulate_along(long, simulate(long, 1), seed, correlation=0.8)[0].error * 3600.0
    # Of a correlated series as many readings count as (1 - rho) / (1 + rho) of it, squares more.
    assert error.std() == pytest.approx(3.0, rel=5.0 * (4.6 / 80_000) ** 0.5)
    found = np.corrcoef(error[1:], error[:-1])[0, 1]
    assert found == pytest.approx(0.8, abs=5.0 * (0.36 / 40_000) ** 0.5)


def test_what_is_no_correlation_is_refused():
    with pytest.raises(ArgumentError, match="correlation must be from 0 to below 1"):
        simulate_along(SIM, simulate(SIM, 1), correlation=1.0)
