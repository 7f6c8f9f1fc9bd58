"""A delay that moves the pattern is confirmed as any other cause is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import delay


def stale() -> ta.CalibrationRun:
    """A sweep there and back with order 4 of 3 deg, read 25 ms late."""
    rng = np.random.default_rng(6431)
    time = np.arange(2000) / 100.0

    def angle(at):
        return 200.0 - 200.0 * np.cos(2.0 * np.pi * at / 20.0)

    then = angle(time - 0.025)
    indicated = then + 3.0 * np.sin(np.radians(4.0 * then)) + rng.normal(0.0, 0.03, time.size)
    return ta.CalibrationRun(angle(time), indicated, period=360.0, time=time)


@pytest.mark.parametrize("low", [-0.1, 0.1])
def test_a_delay_is_confirmed_where_its_gain_excludes_zero(
    monkeypatch: pytest.MonkeyPatch, low: float
) -> None:
    measured = delay.measure_delay_gain
    monkeypatch.setattr(
        delay, "measure_delay_gain", lambda *a: replace(measured(*a), interval=(low, 1.0))
    )
    result = ta.diagnose(stale(), ta.Simulation())
    (found,) = [finding for finding in result.findings if finding.cause == "latency"]
    assert found.confirmed == (low > 0.0)
    assert ("exclude zero" in found.reason) == (low < 0.0)
    told = [effect.kind for effect in result.extended.effects]
    assert ("latency" in told) == (low > 0.0)
