"""Causes over a part of a turn, where a bump or a wander can stand for several others."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import trueangle as ta

#: Half of the play on average, how much it differs by place, arcsec; standard deviation.
HALF, PLACE, SIGMA = 70.0, 60.0, 10.0


def sweeps(seed: int) -> list[ta.CalibrationRun]:
    """Sweeps of 110 deg there and back, with low orders and a play that differs by place."""
    rng = np.random.default_rng(seed)
    start, path = rng.uniform(0.0, 360.0), np.linspace(0.0, 250.0, 400)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    found = []
    for k in range(8):
        speed = (8.0, 30.0)[k % 2]
        at = (path + rng.uniform(0.0, 40.0)) % 220.0
        theta = start + np.minimum(at, 220.0 - at)
        side = np.where(at < 110.0, 1.0, -1.0)
        error = 400.0 * np.sin(np.radians(2.0 * theta) + phase[0])
        error += 200.0 * np.sin(np.radians(5.0 * theta) + phase[1])
        error += side * (HALF + PLACE * np.sin(np.radians(2.0 * theta) + phase[2]))
        error += rng.normal(0.0, SIGMA, theta.size)
        angle = theta + error / 3600.0
        found.append(ta.CalibrationRun(theta, angle, period=360.0, time=path / speed))
    return found


@cache
def diagnosed(seed: int) -> ta.Diagnosis:
    """What is told of the sweeps; both tests look at the same."""
    print(f"seed {seed}")
    return ta.diagnose(sweeps(seed), ta.Simulation())


#: Of the sweeps below those whose lines, of orders 2 and 5, are not only told as neighbours of
#: these that make the same curve over so short a travel.
LINES_TOLD = (6512, 6522)


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("seed", [6511, 6512, 6522])
def test_a_play_by_place_is_told_by_its_direction_and_not_as_bumps(seed: int) -> None:
    result = diagnosed(seed)
    found = {finding.cause: finding for finding in result.findings}
    assert found["direction_dependent_pattern"].confirmed
    assert "local_defect" not in found, result.summary()
    if seed in LINES_TOLD:
        lines = [f for f in result.findings if f.cause == "missing_order" and f.confirmed]
        assert {f.parameters["output_order"].value for f in lines} == {2.0, 5.0}
    assert result.complete
    assert result.gain["rms_after_arcsec"] < 1.1 * SIGMA
    # Over so short a travel its mean and its lines share what they explain.
    if "backlash" in found:
        assert found["backlash"].confirmed
        width = found["backlash"].parameters["half_width_arcsec"]
        assert abs(width.value - HALF) < 4.0 * float(width.std or 0.0) + 0.1 * HALF
        (place,) = found["direction_dependent_pattern"].parameters["amplitudes"].value
        assert abs(place - PLACE) < 0.2 * PLACE


@pytest.mark.usefixtures("patient")
def test_what_the_others_explain_without_a_doubtful_cause_is_not_unexplained() -> None:
    """Of terms that share what they explain, one that is not confirmed takes nothing with it."""
    for seed in (6511, 6521):
        result = diagnosed(seed)
        assert result.unexplained is not None
        assert result.unexplained.rms < SIGMA, result.summary()
