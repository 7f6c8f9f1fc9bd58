"""Borders of the search for orders: what is rounding of angles, and what a coarse sensor adds."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.ordernoise import OrderNoise
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
    noise = OrderNoise(sums, 159 * units, covariance=covariance, rounding=rounding)
    return EvidenceSearch(noise, limits, 1.0, None)


@pytest.mark.parametrize("units", [1, 3])
@pytest.mark.parametrize("covariance", ["auto", "white", "cluster", "hac"])
def test_what_a_coarse_sensor_repeats_adds_to_every_variance(
    covariance: CovarianceKind, units: int
) -> None:
    print("seed", SEED)
    fine, coarse = (search(units, covariance, rounding) for rounding in (0.0, 0.07))
    chosen, orders = [2], range(HIGHEST)
    before, after = (s.noise_of_orders.near(chosen) for s in (fine, coarse))
    own = units > 1 and covariance in ("auto", "cluster")
    assert [scatter is not None for _, scatter in (before, after)] == [own, own]
    if before[1] is not None and after[1] is not None:
        np.testing.assert_allclose(after[1], before[1] + 0.07, rtol=1e-12)
    elif covariance != "hac":
        np.testing.assert_allclose(after[0].variances, before[0].variances + 0.07, rtol=1e-12)
        np.testing.assert_array_equal(after[0].freedoms, before[0].freedoms)
    # What the orders tell together is fitted to variances that are all larger.
    assert (after[0].variance > before[0].variance).all()
    assert np.median(after[0].variance - before[0].variance) == pytest.approx(0.07, rel=0.25)
    statistic = [s.examined(chosen, orders).statistic for s in (fine, coarse)]
    assert (statistic[1] < statistic[0]).all()
