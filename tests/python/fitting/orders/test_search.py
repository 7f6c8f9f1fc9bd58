"""Borders of the search for orders: what is rounding of angles, and what a coarse sensor adds."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.noise import pooled_scatter, run_scatter
from trueangle.fitting.orders.search import EvidenceSearch
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings
from trueangle.fitting.uncertainty import CovarianceKind

SEED = 48_911
HIGHEST = 40


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi, 1.0, 4096.0])
@pytest.mark.parametrize(("part", "orders"), [(0.9e-12, ()), (1.1e-12, (3,))])
def test_less_than_a_millionth_of_a_millionth_of_a_turn_is_rounding(
    part: float, orders: tuple[int, ...], period: float
) -> None:
    turns = np.arange(120) / 60.0
    wave = part * np.sin(2.0 * np.pi * 3.0 * turns)
    run = ta.CalibrationRun(turns * period, (turns + wave) * period, period)
    assert ta.select_orders(run).orders == orders


def search(units: int, covariance: CovarianceKind, rounding: float) -> EvidenceSearch:
    rng = np.random.default_rng(SEED)
    readings = []
    for k in range(units):
        turns = rng.uniform(0.0, 2.0, 160)
        error = 0.3 * rng.normal(size=160) + 0.1 * np.cos(2.0 * np.pi * 3.0 * turns)
        readings.append(ZeroGroupReadings(turns, error, np.ones(160), str(k)))
    sums = harmonic_sums(readings, tuple(range(1, HIGHEST + 1)))
    limits = np.full(HIGHEST, np.log(1e-3))
    return EvidenceSearch(
        sums, limits, 1.0, 159 * units, None, covariance=covariance, rounding=rounding
    )


@pytest.mark.parametrize("units", [1, 3])
@pytest.mark.parametrize("covariance", ["auto", "white", "cluster", "hac"])
def test_what_a_coarse_sensor_repeats_adds_to_every_variance(
    covariance: CovarianceKind, units: int
) -> None:
    print("seed", SEED)
    fine, coarse = (search(units, covariance, rounding) for rounding in (0.0, 0.07))
    chosen = [2]
    before, after = fine._level(chosen), coarse._level(chosen)
    own = covariance == "hac" or (units > 1 and covariance != "white")
    assert [x.scatter is not None for x in (before, after)] == [own, own]
    if before.scatter is None or after.scatter is None:
        assert after.noise[0] == pytest.approx(before.noise[0] + 0.07, rel=1e-12)
        assert after.noise[1] == before.noise[1]
        return
    np.testing.assert_allclose(after.scatter, before.scatter + 0.07, rtol=1e-12)
    if covariance != "hac":
        # What most orders share is pooled from these; which take part may change by it.
        pooled = pooled_scatter(run_scatter(fine.sums, chosen, range(HIGHEST)) + 0.07, units)
        assert pooled is not None
        assert after.noise == pytest.approx(pooled, rel=1e-12)
    statistic = [s.examined(chosen, chosen).statistic[0] for s in (fine, coarse)]
    assert statistic[1] < statistic[0]
