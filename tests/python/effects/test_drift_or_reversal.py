"""A drift in time that may be an error of reversal, and zeros that a drift leaves in each run."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.gain import measure_gain
from trueangle.effects import Backlash, DriftWithinRun
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Simulation

Array = np.ndarray
SEED = 78_000
NOISE = 0.7


def signals_of(runs: int, corners: list[float]) -> Signals:
    """Runs between these places, 240 readings each, at one of every two seconds."""
    made = []
    for k in range(runs):
        way = np.interp(np.linspace(0.0, 1.0, 240), np.linspace(0.0, 1.0, len(corners)), corners)
        theta = 37.0 * k + way
        made.append(ta.CalibrationRun(theta, theta, 360.0, time=2.0 * np.arange(240.0)))
    return join_runs(made)


def regression_of(signals: Signals, error: Array) -> Regression:
    print(f"seed {SEED}")
    noise = NOISE * np.random.default_rng(SEED).standard_normal(len(signals))
    return Regression.of(signals, noise + error, Simulation().surroundings, rho=0.0)


def drifting(signals: Signals, rates: list[float]) -> Array:
    return np.asarray(np.array(rates)[signals.run] * signals.clock)


ONCE, OFTEN, ONE_WAY = [0.0, 350.0, 0.0], [0.0, 300.0, 40.0, 200.0, 30.0, 350.0, 0.0], [0.0, 350.0]


@pytest.mark.parametrize(
    ("runs", "corners", "play", "doubted"),
    [
        (1, ONCE, 3.0, True),
        (2, ONCE, 3.0, True),
        (3, ONCE, 3.0, False),
        (2, ONCE, 0.0, False),
        (2, OFTEN, 3.0, False),
        (2, ONE_WAY, 0.0, False),
    ],
)
@pytest.mark.parametrize("timed", [True, False])
def test_few_runs_that_reverse_once_do_not_tell_a_drift_from_play(
    runs: int, corners: list[float], play: float, doubted: bool, timed: bool
) -> None:
    signals = signals_of(runs, corners)
    if not timed:
        signals = join_runs(
            [
                ta.CalibrationRun(
                    np.degrees(signals.theta[a:b]), np.degrees(signals.theta[a:b]), 360.0
                )
                for a, b in signals.run_bounds()
            ]
        )
    error = play * signals.direction + drifting(signals, [0.02, -0.03, 0.015][:runs])
    regression = regression_of(signals, error)
    waves = np.asarray(signals.clock / signals.clock.max())[:, None]
    found = regression.propose_run_effect(DriftWithinRun.kind, {"form": "ramp"}, waves)
    spot = DriftWithinRun.doubt(found, regression.with_terms([found]), [])
    assert (spot is not None) == doubted
    # Another cause is not doubted for that.
    other = regression.propose(Backlash.kind, {}, signals.direction[:, None])
    assert DriftWithinRun.doubt(other, regression.with_terms([found]), []) is None
    if spot is None:
        return
    assert spot.because.startswith(f"{runs} run{'s' * (runs > 1)} that reverse about once")
    others = ["backlash", "presliding_hysteresis"] + ["latency"] * (not timed)
    assert spot.causes == ("drift_within_run", *others)
    assert "reverse several times within each run" in spot.measure


def test_a_run_that_drifts_keeps_a_zero_of_its_own_where_it_is_held_out() -> None:
    """Beside a drift no run tells where another one starts: its own median is taken."""
    signals = signals_of(5, OFTEN)
    rates = [0.02, -0.03, 0.015, -0.01, 0.035]
    drift, play = drifting(signals, rates), 3.0 * signals.direction
    regression = regression_of(signals, drift + play)
    waves = np.asarray(signals.clock / signals.clock.max())[:, None]
    found = [
        regression.propose_run_effect(DriftWithinRun.kind, {"form": "ramp"}, waves),
        regression.propose(Backlash.kind, {}, signals.direction[:, None]),
    ]
    gains = measure_gain(regression.with_terms(found), [[1]])
    assert gains is not None
    noise = regression.residual - drift - play
    for told, error in ((gains[0].after, drift + noise), (gains[0].before, drift + play + noise)):
        left = error.copy()
        for start, stop in signals.run_bounds():
            left[start:stop] -= np.median(left[start:stop])
        assert told[0] == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=0.01)
        assert told[1] == pytest.approx(float(np.ptp(left)), rel=0.02)
        assert told[2] == pytest.approx(float(np.abs(left).max()), rel=0.02)
    assert "each held-out run with its own zero" in gains[0].holdout
