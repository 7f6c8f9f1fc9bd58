"""Noise of units: Bartlett's test and the law of variances, against scipy."""

import numpy as np
import pytest
from scipy.special import digamma, polygamma
from scipy.stats import bartlett, chi2, kstest

from trueangle.fleets.units import noise_of

SEED = 52_300


def test_the_test_of_equal_noise_is_bartletts():
    """With readings whose sums of squares are given, differ where scipy's p is below 1 %."""
    print("seed", SEED)
    differed = 0
    for seed in range(150):
        rng = np.random.default_rng([SEED, seed])
        sizes = rng.integers(4, 9, int(rng.integers(2, 5)))
        spread = rng.choice([1.0, 3.0])
        readings = [rng.normal(0.0, spread ** rng.normal(), n) for n in sizes]
        squares = np.array([((x - x.mean()) ** 2).sum() for x in readings])
        found = noise_of(squares, sizes - 1.0)
        alike = np.ptp(found.units) == 0.0
        p = bartlett(*readings).pvalue
        # What differs may still be held to one where the logarithms scatter no more than noise.
        assert alike or p < 0.01
        if p < 0.01:
            logs = np.log(squares / (sizes - 1.0)) - digamma((sizes - 1.0) / 2.0)
            logs += np.log((sizes - 1.0) / 2.0)
            more = logs.var(ddof=1) > polygamma(1, (sizes - 1.0) / 2.0).mean()
            assert alike != more
            differed += more
    assert differed > 20


def test_noise_is_held_to_the_common_by_the_moments_of_its_logarithm():
    """Smyth (2004), written out with scipy's functions."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    freedom = rng.integers(5, 40, 30).astype(float)
    own = 4.0 * 6.0 / rng.chisquare(6.0, 30) * rng.chisquare(freedom) / freedom
    found = noise_of(own * freedom, freedom)
    logs = np.log(own) - digamma(freedom / 2.0) + np.log(freedom / 2.0)
    spread = logs.var(ddof=1) - polygamma(1, freedom / 2.0).mean()
    assert float(polygamma(1, found.freedom / 2.0)) == pytest.approx(spread, rel=1e-9)
    common = np.exp(logs.mean() + digamma(found.freedom / 2.0) - np.log(found.freedom / 2.0))
    assert found.variance == pytest.approx(common, rel=1e-9)
    held = (found.freedom * common + freedom * own) / (found.freedom + freedom)
    assert found.units == pytest.approx(held, rel=1e-9)


def test_units_without_a_difference_are_told_one_noise_as_often_as_said():
    """Of 1000 fleets of 12 units: 1 % are told to differ, to 4.5 standard errors."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    told = [np.ptp(noise_of(rng.chisquare(6.0, 12), np.full(12, 6.0)).units) > 0.0
            for _ in range(1000)]  # fmt: skip
    assert sum(told) <= 10 + 4.5 * np.sqrt(9.9)


def test_further_noise_is_as_its_degrees_of_freedom_say():
    """Variances of further units over the common one are those of F with the freedom found."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 3)
    true = 9.0 * 5.0 / rng.chisquare(5.0, 4000)
    found = noise_of(true * rng.chisquare(30.0, 4000), np.full(4000, 30.0))
    assert found.freedom == pytest.approx(5.0, rel=0.15)
    assert kstest(found.freedom * found.variance / true, chi2(found.freedom).cdf).pvalue > 1e-3
