"""Tolerance factors against published and simulated ones."""

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.fleets.tolerance import tolerance_factor, tolerance_of, wilks_units
from trueangle.support.plainresult import plain_row

SEED = 52_001


@pytest.mark.parametrize(
    ("n", "share", "confidence", "sides", "published"),
    [
        (10, 0.95, 0.95, 2, 3.393),
        (43, 0.90, 0.99, 2, 2.2228),
        (43, 0.90, 0.99, 1, 1.8740),
        (2, 0.90, 0.95, 1, 20.581),  # ISO 16269-6
        (10, 0.95, 0.95, 1, 2.911),
    ],
)
def test_factors_are_the_published_ones(n, share, confidence, sides, published):
    assert tolerance_factor(n, share, confidence, sides) == pytest.approx(published, abs=6e-4)


@pytest.mark.parametrize("sides", [1, 2])
def test_a_factor_holds_as_often_as_it_says(sides):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    from scipy.stats import norm

    draws = rng.normal(size=(20_000, 12))
    mean, std = draws.mean(axis=1), draws.std(axis=1, ddof=1)
    k = tolerance_factor(12, 0.9, 0.9, sides)
    low = norm.cdf(mean - k * std) if sides == 2 else 0.0
    held = norm.cdf(mean + k * std) - low >= 0.9
    assert held.mean() == pytest.approx(0.9, abs=0.008)


def test_ranks_need_as_many_units_as_wilks_says():
    assert wilks_units(0.95, 0.95, 1) == 59
    assert wilks_units(0.95, 0.95, 2) == 93
    values = np.arange(1.0, 59.0)
    assert tolerance_of(values, values, 0.95, 0.95).method == "normal"
    values = np.arange(1.0, 60.0)
    found = tolerance_of(values, values, 0.95, 0.95)
    assert (found.method, found.peak_to_peak) == ("wilks", 59.0)
    assert tolerance_of(np.arange(1.0, 94.0), np.arange(1.0, 94.0), 0.95, 0.95).peak_to_peak == 92.0


def test_few_units_are_bounded_by_the_scatter_of_their_logarithms():
    """One-sided, with the standard deviation of n - 1."""
    print("seed", SEED)
    sizes = np.random.default_rng(SEED + 1).lognormal(2.0, 0.4, 10)
    found = tolerance_of(sizes, 0.5 * sizes, 0.9, 0.95)
    assert found.factor == pytest.approx(2.355, abs=6e-4)  # ISO 16269-6, one-sided
    logs = np.log(sizes)
    bound = np.exp(logs.mean() + found.factor * np.sqrt(((logs - logs.mean()) ** 2).sum() / 9.0))
    assert found.peak_to_peak == pytest.approx(bound)
    assert found.left == pytest.approx(0.5 * bound)
    assert plain_row(found, 3600.0)["peak_to_peak_arcsec"] == pytest.approx(3600.0 * bound)


def test_impossible_limits_are_refused():
    with pytest.raises(ArgumentError, match="n must be 2"):
        tolerance_factor(1, 0.9, 0.9)
    with pytest.raises(ArgumentError, match="share must lie"):
        tolerance_factor(5, 1.0, 0.9)
    with pytest.raises(ArgumentError, match="confidence must lie"):
        wilks_units(0.9, 0.0)
    for asked in (tolerance_factor, wilks_units):
        with pytest.raises(ArgumentError, match="sides must be"):
            asked(*((5, 0.9, 0.9, 3) if asked is tolerance_factor else (0.9, 0.9, 3)))
