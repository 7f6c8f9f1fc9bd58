"""A whole diagnosis confirms no finding that what was computed of it speaks against."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

from .test_gates import SIM


def test_drag_is_no_latency():
    """An error that grows with the square of the speed follows it in a form without a name."""
    rng = np.random.default_rng(31)
    runs = []
    for run in ta.simulate(SIM, 12):
        speed = run.speed * 360.0 / run.period
        error = 0.01 * speed * np.abs(speed) + rng.normal(0.0, 1.0, len(run))
        indicated = run.reference + error / 3600.0 * run.period / 360.0
        runs.append(dataclasses.replace(run, indicated=indicated))
    result = ta.diagnose(runs, SIM)
    assert not any(f.confirmed for f in result.findings)
    (factor,) = result.factors
    assert (factor.factor, factor.named_by) == ("speed", ())
    speeds = np.array([-30.0, 30.0])
    (curve,) = factor.effects
    found = np.interp(speeds, curve.at, curve.value_arcsec)
    assert found[1] - found[0] == pytest.approx(2.0 * 0.01 * 900.0, rel=0.05)
    assert result.unexplained is not None
    assert not result.unexplained.found


@pytest.mark.parametrize(
    ("form", "is_ramp"),
    [
        (lambda x: 0.03 * x, True),
        (lambda x: 5.0 * np.tanh((x - 60.0) / 50.0), False),
        (lambda x: 0.05 * np.minimum(x, 120.0), False),
    ],
)
def test_what_rises_over_a_part_of_the_travel_is_no_wrong_ratio(form, is_ramp):
    rng = np.random.default_rng(71300)
    runs = []
    for _ in range(8):
        away = rng.uniform(300.0, 400.0) * (1.0 - np.abs(np.linspace(-1.0, 1.0, 240)))
        theta = rng.uniform(0.0, 360.0) + away
        error = form(away) + rng.normal(0.0, 2.0, away.size)
        runs.append(ta.CalibrationRun(theta, theta + error / 3600.0, period=360.0))
    result = ta.diagnose(runs, Simulation())
    assert [f.cause for f in result.findings if f.confirmed] == ["scale_error"] * is_ramp
    assert not result.unexplained.found
    if not is_ramp:
        ramps = [f for f in result.findings if f.cause == "scale_error"]
        assert all("function of" in ramp.reason for ramp in ramps)
        assert any(not factor.named_by for factor in result.factors)
