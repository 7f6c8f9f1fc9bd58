"""A ramp in angle beside loads and temperatures that run with the angle."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

from .factors.test_factors import confirmed

SIGMA = 0.9

SEEDS = [70_511, 70_513]


def run_of(theta, error, speed, rng, **columns):
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(theta)))])
    indicated = theta + (error + SIGMA * rng.normal(size=theta.size)) / 3600.0
    return ta.CalibrationRun(
        theta, indicated, period=360.0, time=path / speed, label=f"at {speed:g}", **columns
    )


def on_an_arc(law, rng):
    """Out and back over an arc about where a weight hangs to the side: its moment is a ramp."""
    arc, middle = rng.uniform(42.0, 68.0), rng.uniform(0.0, 360.0)
    runs = []
    for k in range(6):
        half = np.sort(rng.uniform(-0.5, 0.5, 110)) * arc
        turned = np.concatenate([half, half[::-1] + rng.uniform(0.01, 0.05)])
        torque = 7.0 * np.sin(np.radians(turned + 4.0))
        runs.append(run_of(middle + turned, law(turned, torque), 8.0 + 3.1 * k, rng, torque=torque))
    return runs


def warming(law, rng, spread=0.0):
    """One way, while it warms up: as much in each run, or another much in each."""
    runs = []
    for k in range(6):
        turned = np.sort(rng.uniform(0.0, 200.0, 230))
        kelvin = 6.0 + spread * (k % 3)
        temperature = 21.0 + spread * (k % 2) + kelvin * turned / 200.0
        runs.append(run_of(turned, law(turned, temperature), 17.0, rng, temperature=temperature))
    return runs


def said(result, *causes):
    """One open question names all of these."""
    return any(spot.supported and {*causes} <= {*spot.causes} for spot in result.not_identifiable)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", [0.09, 0.35])
def test_gravity_on_an_arc_is_no_ratio(size, seed):
    rng = np.random.default_rng(seed)
    result = ta.diagnose(on_an_arc(lambda _, torque: 4.0 * size * torque, rng), Simulation())
    assert confirmed(result) == []
    assert said(result, "torsional_compliance")
    (spot,) = [s for s in result.not_identifiable if s.supported]
    spring = spot.estimates["torsional_compliance"]["arcsec_per_Nm"]
    assert abs(spring.value - 4.0 * size) < 4.0 * spring.std


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", [0.7, 5.0])
@pytest.mark.parametrize("made_by", ["temperature", "angle"])
def test_a_temperature_that_runs_with_the_angle(made_by, size, seed):
    rng = np.random.default_rng(seed)

    def law(turned, temperature):
        return size * (temperature - 21.0) if made_by == "temperature" else size * turned / 33.0

    result = ta.diagnose(warming(law, rng), Simulation())
    assert confirmed(result) == []
    assert said(result, "scale_error", "thermal_drift")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_ramp_under_temperatures_that_do_not_is_one(seed):
    rng = np.random.default_rng(seed)
    result = ta.diagnose(warming(lambda turned, _: turned / 40.0, rng, 4.0), Simulation())
    assert confirmed(result) == ["scale_error"]
    assert not said(result, "thermal_drift")
    rng = np.random.default_rng(seed)
    result = ta.diagnose(warming(lambda _, kelvin: 1.1 * kelvin, rng, 4.0), Simulation())
    assert "scale_error" not in confirmed(result)
    assert not said(result, "scale_error", "thermal_drift")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_ratio_on_an_arc_under_a_load_that_bends_is_one(seed):
    """Over a wider arc the moment of the weight is no ramp any more."""
    rng = np.random.default_rng(seed)
    result = ta.diagnose(on_an_arc(lambda turned, _: 0.6 * turned, rng), Simulation())
    assert confirmed(result) == ["scale_error"]
