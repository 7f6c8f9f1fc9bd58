"""A simulated joint along the motion of runs that there are."""

import secrets
from dataclasses import replace

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.simulation import (
    Backlash,
    Harmonic,
    HeteroscedasticNoise,
    Latency,
    MissingOrder,
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


def test_a_delay_moves_the_lines_that_an_effect_adds_as_well():
    """By the chain of angles itself: what is read was so a moment before."""
    effects = (MissingOrder("output", 7.0, 40.0, 25.0), Latency(2e-3))
    believed = replace(SIM, harmonics=SIM.harmonics, effects=effects)
    design = RunDesign("a", samples=300, speed_deg_s=50.0)
    (run,) = simulate(believed, 4, [design])

    def lines(angle):
        first = 20.0 * np.sin(np.radians(3.0 * angle + 10.0))
        return first + 40.0 * np.sin(np.radians(7.0 * angle + 25.0))

    # To first order in the delay: the true angle moves by it, and the lines with it.
    back = 2e-3 * run.velocity
    wanted = lines(run.reference - back) - 3600.0 * back
    np.testing.assert_allclose(3600.0 * run.error, wanted, atol=0.02)
    (along,) = simulate_along(believed, [run])
    np.testing.assert_allclose(3600.0 * along.error, wanted, atol=0.02)
    np.testing.assert_allclose(believed.predict(run), wanted, atol=0.02)


@pytest.mark.parametrize("correlation", [0.0, 0.5])
def test_noise_that_grows_with_speed_has_the_deviation_of_its_law_along_runs(correlation):
    sim = Simulation(sigma_arcsec=3.0, effects=(HeteroscedasticNoise(per_deg_s=0.05),))
    speeds = np.array([0.0, 20.0, 60.0])
    ideal = simulate(Simulation(), 7, [RunDesign(samples=4000, speed_deg_s=v) for v in speeds])
    found = [3600.0 * np.std(run.error) for run in simulate_along(sim, ideal, 8, correlation)]
    assert found == pytest.approx(3.0 * np.exp(0.025 * speeds), rel=0.08)
