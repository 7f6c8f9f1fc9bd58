"""The test whether two models are one pattern, against scipy and matrices written out."""

import math

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.export.comparison import FALSE_ALARMS, pattern_equality
from trueangle.model.records import FitRecord

SEED = 91
ORDERS = [1, 2, 5]

#: Of a tail with 1e9 degrees of freedom, which stand for infinitely many.
ROUNDED = 3e-6


def covariance(rng, size):
    half = rng.normal(size=(2 * size + 1, 2 * size + 1))
    return 1e-6 * half @ half.T


def model(values, orders, spread, samples=None):
    fit = None
    if samples is not None:
        fit = FitRecord(samples=samples, runs=2, span=(0.0, 1.0), residual=1e-3, wild=3)
    shaft = ta.Shaft("output", 1, orders, list(values[0::2]), list(values[1::2]))
    return ta.HarmonicModel([shaft], covariance=spread, fit=fit)


@pytest.mark.parametrize("samples", [(None, None), (60, 400), (30, 30), (None, 50)])
@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1.0, 30.0), (9.0, 0.1)])
def test_common_orders_are_compared_by_both_covariances(samples, sizes):
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    first, second = (size * covariance(rng, 3) for size in sizes)
    values = 0.01 * rng.normal(size=6)
    apart = 2e-3 * rng.normal(size=6)
    one = model(values, ORDERS, first, samples[0])
    other = model(values + apart, ORDERS, second, samples[1])
    found = pattern_equality(one, other)
    spreads = [m[1:, 1:] for m in (first, second)]
    statistic = apart @ np.linalg.solve(spreads[0] + spreads[1], apart)
    assert found.statistic == pytest.approx(statistic, rel=1e-6)
    # Readings less wild ones, zeros of runs and coefficients; Satterthwaite's sum.
    freedom = [math.inf if n is None else n - 3 - 2 - 6 for n in samples]
    traces = [np.trace(s) for s in spreads]
    doubt = sum(t**2 / f for t, f in zip(traces, freedom, strict=True))
    p = (
        stats.chi2.sf(statistic, 6)
        if doubt == 0.0
        else stats.f.sf(statistic / 6, 6, sum(traces) ** 2 / doubt)
    )
    assert found.p == pytest.approx(p, rel=ROUNDED)
    assert found.orders == 3
    assert found.verdict == ("changed" if p <= FALSE_ALARMS else "same")


@pytest.mark.parametrize("swapped", [False, True])
def test_an_order_that_one_lacks_is_tried_by_itself(swapped):
    rng = np.random.default_rng(SEED)
    spread = covariance(rng, 3)
    values = np.concatenate([0.01 * rng.normal(size=4), [0.01, 0.02]])
    pair = [model(values, ORDERS, spread), model(values[:4], ORDERS[:2], spread[:5, :5])]
    found = pattern_equality(*pair[::-1] if swapped else pair)
    alone = values[4:] @ np.linalg.solve(2.0 * spread[5:, 5:], values[4:])
    # Of an order chosen by its size among some hundred.
    assert found.p == pytest.approx(min(1.0, 220 * stats.chi2.sf(alone, 2)), rel=ROUNDED)
    assert (found.statistic, found.orders) == (pytest.approx(0.0, abs=1e-12), 2)


def test_what_no_test_can_tell():
    rng = np.random.default_rng(SEED)
    values, spread = 0.01 * rng.normal(size=6), covariance(rng, 3)
    told, untold = model(values, ORDERS, spread), model(values, ORDERS, None)
    other = model(values, [3, 4, 6], spread)
    singular = model(values, ORDERS, np.zeros((7, 7)))
    assert pattern_equality(told, untold) is None
    assert pattern_equality(untold, told) is None
    assert pattern_equality(told, other) is None
    assert pattern_equality(singular, singular) is None
    assert pattern_equality(told, told).p == pytest.approx(1.0)
