"""A line in time beside what is unexplained: confirmed where a test without names sees it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.confirmation import confirmation_status
from trueangle.diagnosis.goodness import Noise, Unexplained
from trueangle.effects import TimePeriodic
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation

SEED = 5
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(RunDesign(samples=300, start_deg=40.0 * k, reversals=(0.3, 0.7)) for k in range(4)),
)
PHASES = np.array([0.3, 1.9, 4.0, 5.5])


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


@pytest.mark.parametrize("unexplained", [True, False])
@pytest.mark.parametrize(("told", "seen"), [(0.9, True), (0.91, True), (0.5, False), (2.7, False)])
def test_a_line_in_time_is_confirmed_at_the_frequency_that_is_seen_without_it(
    told: float, seen: bool, unexplained: bool, signals: Signals
) -> None:
    print(f"seed {SEED}")
    line = 2.0 * np.cos(2.0 * np.pi * 0.9 * signals.clock + PHASES[signals.run])
    noise = np.random.default_rng(SEED).normal(size=len(signals))
    start = Regression.of(signals, noise + line, SIM.surroundings, rho=0.0)
    found = TimePeriodic.propose(start)
    assert found is not None
    assert found.shape["frequency_hz"] == pytest.approx([0.9] * 4, rel=1e-3)
    claimed = replace(found, shape={**found.shape, "frequency_hz": [told] * 4})
    left = Unexplained(unexplained, 1.0, 0.1, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0))
    status, reason = confirmation_status(
        "time_periodic", None, start.with_terms([claimed]), [0], left
    )
    if seen or not unexplained:
        assert (status, reason) == ("confirmed", "")
    else:
        assert status == "not_confirmed"
        assert "this cause takes up whatever is left" in reason
