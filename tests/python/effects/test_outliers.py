"""Outliers, alone and in bursts, with their rows; what lasts or fades is none."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.estimation.stretches import MOST_IN_ROW, about_level, short_stretches, stretches
from trueangle.simulation import RunDesign, Simulation

SIM = Simulation(
    sigma_arcsec=1.5,
    runs=tuple(
        RunDesign(samples=300, start_deg=31.0 * k, turns=1.4, speed_deg_s=v, reversals=(0.4,))
        for k, v in enumerate((5.0, 30.0) * 4)
    ),
)


def with_bursts(length: int, size: float, alike: bool, seed: int) -> tuple[list, set]:
    rng = np.random.default_rng([seed, length, int(size), alike])
    runs, rows = [], set()
    for j, run in enumerate(ta.simulate(SIM, seed)):
        indicated = run.indicated.copy()
        half = len(run) // 2
        for start in (rng.integers(8, half - 20), rng.integers(half, len(run) - 12)):
            sign = rng.choice([-1.0, 1.0], 1 if alike else length)
            wild = sign * rng.uniform(0.7, 1.4, length) * size * SIM.sigma_arcsec
            indicated[start : start + length] += wild / 1_296_000.0 * run.period
            rows |= {(str(run.label or j + 1), int(start + k)) for k in range(length)}
        runs.append(
            ta.CalibrationRun(
                run.reference, indicated, period=run.period, time=run.time, label=run.label
            )
        )
    return runs, rows


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("size", [10.0, 30.0, 300.0])
@pytest.mark.parametrize("length", [2, 3, MOST_IN_ROW])
def test_bursts_are_named_with_their_rows(length, size, alike):
    runs, rows = with_bursts(length, size, alike, seed=6_100)
    result = ta.diagnose(runs, SIM)
    assert [f.cause for f in result.findings if f.confirmed] == ["outliers"]
    told = {(label, row) for label, row in result.findings[0].parameters["rows"].value}
    assert len(rows - told) <= 1
    assert len(told - rows) <= 4
    assert result.findings[0].parameters["bursts"].value >= 15
    # The other readings are what they were.
    assert result.noise == pytest.approx(SIM.sigma_arcsec, rel=0.06)
    assert result.correlation == 0.0
    assert result.unexplained is not None
    assert not result.unexplained.found


def test_stretches_end_with_their_runs():
    flags = np.array([1, 1, 0, 1, 1, 1, 0, 1], dtype=bool)
    starts, stops = stretches(flags, [(0, 4), (4, 8)])
    assert list(zip(starts.tolist(), stops.tolist(), strict=True)) == [
        (0, 2), (3, 4), (4, 6), (7, 8),
    ]  # fmt: skip
    assert not short_stretches(np.ones(MOST_IN_ROW + 1, dtype=bool), [(0, MOST_IN_ROW + 1)]).any()
    assert not short_stretches(np.zeros(5, dtype=bool), [(0, 5)]).any()


def test_the_level_about_a_reading_is_a_median_of_eleven():
    rng = np.random.default_rng(5)
    values = rng.normal(size=60) + np.linspace(0.0, 30.0, 60)
    found = about_level(values, [(0, 40), (40, 60)])
    for k in range(5, 35):
        assert found[k] == pytest.approx(values[k] - np.median(values[k - 5 : k + 6]))
    short = about_level(values[:4], [(0, 4)])
    np.testing.assert_allclose(short, values[:4] - np.median(values[:4]))
