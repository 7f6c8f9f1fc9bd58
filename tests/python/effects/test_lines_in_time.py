"""Lines of a fixed frequency: what a search for them finds and pays, and what else they may be."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import TimePeriodic
from trueangle.effects.time_periodic import OVERSAMPLING, _fixed
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import line_columns
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Joint, RunDesign, Simulation

Array = np.ndarray
SEED = 86_000


def regression_of(
    speeds: tuple[float, ...], error: float = 0.0, ratio: float = 1.0, samples: int = 300
) -> Regression:
    """Runs one way at these speeds, with a line of order 7 where there is an error."""
    print(f"seed {SEED}")
    joint = Joint(ratio)
    designs = [
        RunDesign(samples=samples, turns=1.3, start_deg=31.0 * k, speed_deg_s=v)
        for k, v in enumerate(speeds)
    ]
    signals = join_runs(ta.simulate(Simulation(joint, sigma_arcsec=1.0, runs=tuple(designs)), 3))
    y = np.random.default_rng(SEED).standard_normal(len(signals))
    y += error * np.cos(7.0 * signals.theta)
    return Regression.of(signals, y, Simulation(joint).surroundings, rho=0.0)


@pytest.mark.parametrize("strength", [0.0, 8.0, 60.0])
def test_one_frequency_for_all_runs_saves_the_most_at_the_best_ratio(strength: float) -> None:
    """By the likelihood of a variance of each run's line, over thirteen ratios to the noise."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    frequencies, sizes = 0.1 * np.arange(20, 220), np.array([300.0, 40.0, 1000.0])
    p = rng.exponential(2.0, (200, 3))
    p[73] += strength
    best = []
    for row in p:
        saved = [0.0]
        for ratio in np.geomspace(1e-3, 1e3, 13):
            wider = 1.0 + ratio * sizes / 2.0
            saved.append(float(np.sum(row * (1.0 - 1.0 / wider) - 2.0 * np.log(wider))))
        best.append(max(saved))
    places, deviance, log_grid = _fixed(frequencies, p, sizes)
    assert deviance == pytest.approx(max(best))
    if strength:
        assert int(np.argmax(best)) == 73
    np.testing.assert_array_equal(places, [int(np.argmax(best))] * 3)
    # Three trial frequencies a resolution cell, of two coefficients.
    assert log_grid == pytest.approx(np.log(2.0 * 200.0 / OVERSAMPLING))


def line_of(regression: Regression, frequency: float, deviance: float = 0.0) -> Extension:
    signals = regression.signals
    found = regression.propose_run_effect(
        "time_periodic",
        {"frequency_hz": [frequency] * signals.runs},
        TimePeriodic.waves(signals, [frequency] * signals.runs),
    )
    assert found.run_effect is not None
    return Extension(
        found.cause, found.shape, found.columns, 1, 0.0, deviance, 1.0, found.run_effect
    )


@pytest.mark.parametrize("ratio", [1.0, 9.0])
@pytest.mark.parametrize("order", [4.5, 11.5, 12.5, 100.0, 120.0])
@pytest.mark.parametrize("change", [0.0, 0.06, 0.2])
def test_at_one_speed_a_line_in_time_may_be_one_of_an_order(
    change: float, order: float, ratio: float
) -> None:
    """Up to twelve orders of the fastest shaft, which bearings have; a tenth is another speed."""
    speeds = tuple(20.0 * (1.0 + change * k / 3.0) for k in range(4))
    regression = regression_of(speeds, ratio=ratio)
    level = float(np.median(np.abs(regression.signals.turns_per_s)))
    found = line_of(regression, order * level)
    spot = TimePeriodic.doubt(found, regression, [])
    assert (spot is not None) == (change < 0.1 and order <= 12.0 * ratio)
    if spot is not None:
        assert spot.because == (
            f"one speed: a line of {order * level:.4g} Hz and one of order {order:.4g} with a "
            "new phase in every run are the same"
        )
        assert spot.causes == ("time_periodic", "non_integer_order")
    other = regression.propose("backlash", {}, regression.signals.direction[:, None])
    assert TimePeriodic.doubt(other, regression, []) is None


@pytest.mark.parametrize("runs", [2, 3, 5])
def test_a_line_that_keeps_its_phase_in_angle_is_an_order(runs: int) -> None:
    """Where an order with one phase explains more than half and what new phases leave of it."""
    regression = regression_of((20.0,) * runs, 3.0)
    signals: Signals = regression.signals
    gain, _ = regression.gain(line_columns(signals.theta, 7.0))
    level = float(np.median(np.abs(signals.turns_per_s)))
    for share in (0.99, 1.01):
        found = line_of(regression, 7.0 * level, gain / (share * (0.5 + 1.0 / runs)))
        assert TimePeriodic._keeps_phase(regression, found) == (share > 1.0)
    # Another frequency, which no order near it explains, is none.
    far = line_of(regression, 9.0 * level, gain)
    assert not TimePeriodic._keeps_phase(regression, far)
