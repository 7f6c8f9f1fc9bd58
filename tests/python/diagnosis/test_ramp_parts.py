"""A ramp is confirmed where every part of the travel has its slope."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.confirmation import CONFIRMED
from trueangle.diagnosis.gates import gated_findings
from trueangle.effects import ScaleError
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs

from .test_gates import SIM, finding


def ramped(slopes: tuple[float, ...], seed: int) -> Regression:
    """A ramp whose slope differs from quarter to quarter of its travel, and a term of it."""
    print(f"seed {seed}")
    signals = join_runs(ta.simulate(SIM, 11))
    column = ScaleError.columns(signals, SIM.surroundings, {"from": "start"})[:, 0]
    edges = np.quantile(column, [0.0, 0.25, 0.5, 0.75, 1.0])
    parts = np.column_stack([np.clip(column, *edges[k : k + 2]) for k in range(4)])
    y = parts @ np.array(slopes) * 1e-6
    noise = np.random.default_rng(seed).standard_normal(len(signals))
    start = Regression.of(signals, y + noise, SIM.surroundings, rho=0.0)
    ramp = start.propose("scale_error", {"from": "start"}, column[:, None])
    return start.with_terms([ramp])


@pytest.mark.parametrize(
    ("slopes", "passes"),
    [((30.0, 30.0, 30.0, 30.0), True), ((30.0, 30.0, 30.0, -30.0), False),
     ((-40.0, -40.0, 5.0, -40.0), False), ((100.0, 25.0, 25.0, 25.0), False),
     ((60.0, 25.0, 25.0, 25.0), True),
     ((30.0, 30.0, 20.0, 30.0), True)],
)  # fmt: skip
def test_a_ratio_is_wrong_in_every_part_of_the_travel_alike(slopes, passes):
    """By the slopes of four parts by least squares, each against the best mean of the others."""
    fitted = ramped(slopes, 71_301)
    ramp = dataclasses.replace(finding("scale_error"), group=(0,))
    (told,), _, _ = gated_findings(fitted, [ramp])
    assert (told.status == CONFIRMED) == passes
    assert (told.reason == "") == passes
    # Another cause, and one that is not confirmed, are not asked.
    (other,), _, _ = gated_findings(fitted, [dataclasses.replace(ramp, cause="clock_drift")])
    assert other.status == CONFIRMED
    said, _ = parts_that_differ(fitted)
    assert bool(said) != passes
    assert passes or told.reason.endswith(said[0])


def test_what_noise_makes_of_a_ramp_is_no_other_law():
    """Three standard errors, of a ramp that is hardly there; a few of many are beyond two."""
    largest = []
    for seed in range(71_310, 71_325):
        fitted = ramped((1.0,) * 4, seed)
        ramp = dataclasses.replace(finding("scale_error"), group=(0,))
        (told,), _, _ = gated_findings(fitted, [ramp])
        said, z = parts_that_differ(fitted)
        assert bool(told.reason) == bool(said)
        largest.append(z)
    assert sum(2.0 < z < 3.0 for z in largest) > 1


def parts_that_differ(fitted: Regression) -> tuple[list[str], float]:
    """Slopes of parts that are others than elsewhere, and the largest difference of one."""
    largest = 0.0
    column = fitted.terms[0].columns[:, 0]
    edges = np.quantile(column, [0.0, 0.25, 0.5, 0.75, 1.0])
    parts = np.column_stack([np.clip(column, *edges[k : k + 2]) for k in range(4)])
    design = np.column_stack([fitted.base, parts])
    own = np.linalg.lstsq(design, fitted.residual, rcond=None)[0][-4:]
    spread = np.linalg.inv(design.T @ design)[-4:, -4:]
    said = []
    for j in range(4):
        others = [k for k in range(4) if k != j]
        precision = np.linalg.inv(spread[np.ix_(others, others)])
        mean = precision.sum(axis=0) @ own[others] / precision.sum()
        z = (own[j] - mean) / np.sqrt(
            spread[j, j] + 1.0 / precision.sum()
            - 2.0 * spread[j, others] @ precision.sum(axis=0) / precision.sum()
        )  # fmt: skip
        if 1.0 - ((own[j] - mean) / own[j]) ** 2 < 0.5:
            largest = max(largest, abs(z))
        if abs(z) > 3.0 and 1.0 - ((own[j] - mean) / own[j]) ** 2 < 0.5:
            said.append(f"({1e6 * own[j]:.2g} ppm in one, {1e6 * mean:.2g} in the others)")
    return said, largest
