"""Departures of an effect from its law, against their definitions one reading after the other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.departures import LAG, LENGTHS, departure_columns
from trueangle.joint.signals import Signals, join_runs

from .test_stated_errors import SIM

Array = np.ndarray


@pytest.fixture(scope="module")
def signals() -> Signals:
    sim = replace(SIM, runs=tuple(replace(run, samples=60) for run in SIM.runs))
    return join_runs(ta.simulate(sim, 3))


def lagging(signals: Signals, values: Array) -> Array:
    """Slow: a low-pass over a share of each run, from its first value on."""
    late = values.copy()
    for start, stop in signals.run_bounds():
        keep = math.exp(-1.0 / (LAG * (stop - start)))
        for i in range(start + 1, stop):
            late[i] = keep * late[i - 1] + (1.0 - keep) * values[i]
    return late


@pytest.mark.parametrize("factor", ["torque", "temperature", "velocity"])
def test_a_law_departs_by_curvature_lag_and_a_loop(factor: str, signals: Signals) -> None:
    x = getattr(signals, factor)
    signal = 3.0 * x * np.cos(signals.theta) + 0.2
    columns = departure_columns(signals, factor, signal)
    if factor == "temperature":
        x = x - x.mean()
    x = x / np.abs(x).max()
    curved = signal[:, None] * np.column_stack([x, np.abs(x), x**2, np.abs(x) ** 3])
    along = (signal @ curved) / (signal @ signal)
    late = lagging(signals, signal)
    loop = np.abs(signal) * np.sign(signal - late)
    wanted = np.column_stack([curved - np.outer(signal, along), late - signal, loop])
    # Where it has not moved yet the loop has no side.
    sure = np.abs(signal - late) > 1e-9 * np.abs(signal).max()
    np.testing.assert_allclose(columns[sure], wanted[sure], atol=1e-9 * np.abs(wanted).max())
    # As large as the error, in any unit of the factor.
    scaled = replace(signals, **{factor: 1e3 * getattr(signals, factor)})
    np.testing.assert_allclose(
        departure_columns(scaled, factor, signal)[sure], columns[sure], atol=1e-9
    )


def test_an_error_of_reversal_departs_by_transitions_relaxed_and_run_in(signals: Signals) -> None:
    """What is read in place of it where the direction has been changing for a while."""
    signal = 4.0 * signals.direction
    columns = departure_columns(signals, "direction", signal)
    assert columns.shape == (len(signals), 2 * len(LENGTHS))
    for k, (start, length) in enumerate((s, x) for s in (0.0, 1.0) for x in LENGTHS):
        state = signals.presliding(length, start)
        np.testing.assert_allclose(columns[:, k], 4.0 * state - signal, atol=1e-12)


def test_a_factor_that_was_not_recorded_or_stands_still_bends_nothing(signals: Signals) -> None:
    signal = np.cos(signals.theta)
    for other in (replace(signals, torque=None), replace(signals, torque=0.0 * signal + 3.0)):
        assert departure_columns(other, "torque", signal).shape == (len(signals), 0)
