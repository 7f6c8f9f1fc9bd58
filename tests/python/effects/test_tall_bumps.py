"""Bumps and loops many times the noise: their shape, and how well it is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.effects.search import tangent_covariance
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import (
    Harmonic,
    LocalDefect,
    PreslidingHysteresis,
    RunDesign,
    Simulation,
    simulate,
)

#: Root mean square of 24 pulls of standard deviation 1, but for a chance of 1e-3 each way.
LOW, HIGH = 0.55, 1.5

BASE = Simulation(sigma_arcsec=1.0, harmonics=(Harmonic("output", 3, 20.0),))


def pulls(sim: Simulation, hidden: list, names: tuple[str, ...]) -> np.ndarray:
    """(estimate - truth) / std of the parameters of the one finding, per seed."""
    found = []
    for seed, effect in enumerate(hidden):
        result = ta.diagnose(simulate(sim.with_effects([effect]), seed), sim, gain=False)
        assert [finding.cause for finding in result.findings] == [effect.kind], seed
        told = result.findings[0].parameters
        found.append([(told[n].value - getattr(effect, n)) / told[n].std for n in names])
    return np.array(found)


@pytest.mark.parametrize("height", [20.0, 150.0])
@pytest.mark.parametrize("width", [3.0, 7.5])
def test_a_bump_is_where_it_is_however_tall(height, width):
    """At 100 times the noise places and widths had been off by 5 and 20 standard errors."""
    designs = (RunDesign(samples=160), RunDesign(samples=160, direction=-1, start_deg=40.0))
    sim = Simulation(sigma_arcsec=1.0, harmonics=BASE.harmonics, runs=(*designs, designs[0]))
    hidden = [LocalDefect(11.0 + 14.3 * k, width, height) for k in range(24)]
    found = pulls(sim, hidden, ("place_deg", "width_deg", "height_arcsec"))
    rms = np.sqrt(np.mean(found**2, axis=0))
    assert (rms > LOW).all(), rms
    assert (rms < HIGH).all(), rms


def test_the_length_of_a_wind_up_is_known_as_well_as_is_told():
    sweep = RunDesign(samples=240, turns=2.0, reversals=(0.2, 0.5, 0.8), speed_deg_s=10.0)
    runs = (sweep, replace(sweep, speed_deg_s=30.0), sweep)  # of one speed it may be a delay
    sim = Simulation(sigma_arcsec=1.0, harmonics=BASE.harmonics, runs=runs)
    hidden = [PreslidingHysteresis(25.0, 3.0 + 0.1 * k) for k in range(24)]
    found = pulls(sim, hidden, ("amplitude_arcsec", "length_deg"))
    rms = np.sqrt(np.mean(found**2, axis=0))
    assert (rms < HIGH).all(), rms


@pytest.mark.parametrize("seed", range(3))
def test_shapes_are_known_by_the_noise_beside_them(seed):
    """White noise: the inverse of the tangents' products beside the zero and the line."""
    sim = Simulation(sigma_arcsec=1.0, harmonics=BASE.harmonics, runs=(RunDesign(samples=400),) * 2)
    measured = simulate(sim.with_effects([LocalDefect(120.0, 6.0, 90.0)]), seed)
    signals = join_runs(measured)
    start = Regression.of(
        signals, unfolded_error(measured) - sim.predict(signals), sim.surroundings
    )
    assert start.whiten.rho > 0.5  # the bump, taken for noise
    shape = {"shaft": "output", "place_deg": 120.0, "width_deg": 6.0}
    columns = LocalDefect.columns(signals, start.around, shape)
    fitted = start.with_terms([start.propose(LocalDefect.kind, shape, columns)])
    assert fitted.whiten.rho < 0.1
    tangents = LocalDefect._tangents(fitted, shape, 90.0)
    term, coefficients = fitted.fitted()[0]
    found = tangent_covariance(fitted, [(term, coefficients, fitted.covariance(0))], tangents)
    beside = start.base
    x = tangents - beside @ np.linalg.lstsq(beside, tangents, rcond=None)[0]
    wanted = np.linalg.inv(x.T @ x)
    # The variance is that of the fit, and the noise may be correlated by a little.
    assert np.sqrt(np.diag(found)) == pytest.approx(np.sqrt(np.diag(wanted)), rel=0.15)


@pytest.mark.parametrize("length", [0.15, 0.25])
def test_a_length_between_two_readings_is_not_known_exactly(length):
    """The first reading after the reversal stands 3.4 deg from it: the error was told as 0."""
    run = RunDesign(samples=105, turns=2.0, reversals=(0.5,), spacing="uniform")
    sim = Simulation(sigma_arcsec=2.0, harmonics=BASE.harmonics, runs=(run,) * 2)
    hidden = PreslidingHysteresis(25.0, 0.5)
    signals = join_runs(measured := simulate(sim.with_effects([hidden]), 7))
    left = unfolded_error(measured) - sim.predict(signals)
    start = Regression.of(signals, left, sim.surroundings)
    shape = {"length_deg": length, "start_state": 1.0}
    columns = PreslidingHysteresis.columns(signals, start.around, shape)
    fitted = start.with_terms([start.propose(hidden.kind, shape, columns)])
    term, coefficients = fitted.fitted()[0]
    told, _ = PreslidingHysteresis.report(fitted, [(term, coefficients, fitted.covariance(0))])
    assert told["length_deg"].std == 60.0  # the longest that is looked for
    size = told["amplitude_arcsec"]
    assert abs(size.value - hidden.amplitude_arcsec) < 4.0 * size.std
