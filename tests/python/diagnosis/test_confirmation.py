"""A line in time beside what is unexplained: confirmed where a test without names sees it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.confirmation import confirmation_status
from trueangle.diagnosis.gain import Gain
from trueangle.diagnosis.goodness import Noise, Unexplained
from trueangle.effects import TimePeriodic
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import line_columns
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation

SEED = 5
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(RunDesign(samples=300, start_deg=40.0 * k, reversals=(0.3, 0.7)) for k in range(4)),
)
PHASES = np.array([0.3, 1.9, 4.0, 5.5])
CALM = Unexplained(False, 1.0, 0.1, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0, 0.0))


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
    left = Unexplained(unexplained, 1.0, 0.1, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0, 0.0))
    status, reason = confirmation_status(
        "time_periodic", None, start.with_terms([claimed]), [0], left
    )
    if seen or not unexplained:
        assert (status, reason) == ("confirmed", "")
    else:
        assert status == "not_confirmed"
        assert "fits nearly any residual" in reason


def drawn_in(share: int, runs: int, seed: int) -> Regression:
    """Runs of which the first few draw a line of their own anew, fitted as a run effect."""
    sim = replace(SIM, runs=tuple(replace(SIM.runs[0], start_deg=40.0 * k) for k in range(runs)))
    signals = join_runs(ta.simulate(sim, 3))
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 2.0 * np.pi, runs)[signals.run]
    line = np.where(signals.run < share, 0.7, 0.0) * np.cos(3.0 * signals.theta + phase)
    error = line + rng.normal(size=len(signals))
    start = Regression.of(signals, error, sim.surroundings, rho=0.0)
    columns = line_columns(signals.theta, 3.0)
    return start.with_terms([start.propose_run_effect("varying_line", {"order": 3.0}, columns)])


@pytest.mark.parametrize(
    ("share", "runs", "every"), [(3, 3, True), (1, 3, True), (1, 4, False), (4, 4, True),
                                 (1, 8, False), (8, 8, True)],
)  # fmt: skip
def test_what_every_run_draws_anew_explains_the_noise_of_them_all(
    share: int, runs: int, every: bool
) -> None:
    """From four runs on, below which a resample of them tells nothing."""
    print("seed 17")
    fitted = drawn_in(share, runs, 17)

    status, reason = confirmation_status("varying_line", None, fitted, [0], CALM)
    assert (status == "confirmed") == every
    assert reason == ("" if every else "it explains the noise of some runs only")


@pytest.mark.parametrize(
    ("interval", "confirmed"),
    [((0.01, 0.5), True), ((-0.01, 0.5), False), ((-0.5, -0.01), False), (None, True)],
)
def test_a_gain_on_held_out_readings_is_above_zero_at_both_ends(
    interval: tuple[float, float] | None, confirmed: bool
) -> None:
    gain = Gain("runs", (1.0, 3.0, 2.0), (0.9, 2.8, 1.9), 0.2, interval, None, "")
    status, reason = confirmation_status("missing_order", gain, None, [0], CALM)
    assert (status == "confirmed") == confirmed
    assert ("includes zero" in reason) != confirmed


@pytest.mark.parametrize(
    ("true", "claimed", "whole"),
    [(3.0, 3.01, True), (3.0, 2.98, True), (3.2, 3.2, False), (2.55, 2.55, False)],
)
def test_a_whole_order_that_changes_from_run_to_run_is_no_other_order(
    true: float, claimed: float, whole: bool, signals: Signals
) -> None:
    print("seed 19")
    rng = np.random.default_rng(19)
    phase = rng.uniform(0.0, 2.0 * np.pi, 4)[signals.run]
    error = 3.0 * np.cos(true * signals.theta + phase) + rng.normal(size=len(signals))
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    columns = line_columns(signals.theta, claimed)
    term = start.propose_run_effect("non_integer_order", {"order": claimed}, columns)
    status, reason = confirmation_status(
        "non_integer_order", None, start.with_terms([term]), [0], CALM
    )
    assert (status == "confirmed") != whole
    assert reason == (
        "order 3 with another size or phase in every run explains as much" if whole else ""
    )


@pytest.mark.parametrize("runs", [1, 2])
def test_a_line_in_time_of_one_run_alone_is_not_confirmed_by_what_is_seen(runs: int) -> None:
    """Another phase in another run is what tells it from an order."""
    print(f"seed {SEED}")
    signals = join_runs(ta.simulate(replace(SIM, runs=SIM.runs[:runs]), 3))
    line = 2.0 * np.cos(2.0 * np.pi * 0.9 * signals.clock + PHASES[signals.run])
    noise = np.random.default_rng(SEED).normal(size=len(signals))
    start = Regression.of(signals, noise + line, SIM.surroundings, rho=0.0)
    waves = TimePeriodic.waves(signals, [0.9] * runs)
    claimed = start.propose_run_effect("time_periodic", {"frequency_hz": [0.9] * runs}, waves)
    left = Unexplained(True, 1.0, 0.1, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0, 0.0))
    status, _ = confirmation_status("time_periodic", None, start.with_terms([claimed]), [0], left)
    assert (status == "confirmed") == (runs > 1)
