"""Distributions against scipy, against printed tables, and against their own inverses."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy import special, stats

from trueangle.errors import ArgumentError
from trueangle.support import distributions as ours

#: lgamma is good to an ulp of its value: with arguments up to 1e6 the front factor keeps this.
RELATIVE = 2e-9
#: Smaller degrees of freedom leave lgamma small.
RELATIVE_SMALL = 5e-13

DEGREES = [0.3, 1.0, 2.0, 3.7, 10.0, 99.0, 1e3]


@pytest.mark.parametrize("nu", [*DEGREES, 1e6])
@pytest.mark.parametrize("t", [-40.0, -3.0, -0.2, 0.0, 0.5, 1.0, 2.0, 6.0, 30.0])
def test_student_is_scipys(nu: float, t: float) -> None:
    close = RELATIVE_SMALL if nu <= 1e3 else RELATIVE
    assert ours.student_tail(t, nu) == pytest.approx(stats.t.sf(t, nu), rel=close, abs=1e-300)


@pytest.mark.parametrize("nu", [*DEGREES, 1e6])
@pytest.mark.parametrize("p", [1e-9, 0.01, 0.4, 0.5, 0.9, 0.975, 0.97725, 1 - 1e-6])
def test_quantiles_are_scipys(nu: float, p: float) -> None:
    assert ours.student_quantile(p, nu) == pytest.approx(stats.t.ppf(p, nu), rel=1e-8, abs=1e-12)
    assert ours.chi_squared_quantile(p, nu) == pytest.approx(stats.chi2.ppf(p, nu), rel=1e-7)
    assert ours.f_quantile(p, nu, 7.0) == pytest.approx(stats.f.ppf(p, nu, 7.0), rel=1e-7)


@pytest.mark.parametrize("nu", [*DEGREES, 1e6])
@pytest.mark.parametrize("ratio", [1e-3, 0.2, 0.9, 1.0, 1.1, 2.0, 20.0])
def test_chi_squared_and_f_are_scipys(nu: float, ratio: float) -> None:
    x = ratio * nu
    close = RELATIVE_SMALL if nu <= 1e3 else RELATIVE
    assert ours.chi_squared_tail(x, nu) == pytest.approx(
        stats.chi2.sf(x, nu), rel=close, abs=1e-300
    )
    for other in (1.0, 12.0, math.inf):
        want = stats.f.sf(ratio, nu, other if math.isfinite(other) else 1e15)
        assert ours.f_tail(ratio, nu, other) == pytest.approx(want, rel=1e-8, abs=1e-300)


def test_student_near_its_centre_is_its_density() -> None:
    # Where scipy itself rounds to one half: Cauchy's distribution has 1/pi there.
    assert ours.student_tail(1e-9, 1.0) == pytest.approx(0.5 - 1e-9 / math.pi, rel=1e-15)


def test_printed_tables() -> None:
    # GUM Table G.2: t for p = 95.45 %.
    for nu, printed in {1: 13.97, 2: 4.53, 5: 2.65, 10: 2.28, 50: 2.05}.items():
        assert round(ours.student_quantile(0.5 + 0.9545 / 2.0, nu), 2) == printed
    assert round(ours.student_quantile(0.5 + 0.9545 / 2.0, math.inf), 3) == 2.000
    assert round(ours.chi_squared_quantile(0.95, 10), 3) == 18.307
    assert round(ours.f_quantile(0.95, 3, 20), 2) == 3.10


def test_quantile_and_tail_are_inverse() -> None:
    rng = np.random.default_rng(20261121)
    for p, nu in zip(rng.uniform(1e-6, 1.0, 100), rng.uniform(0.5, 300.0, 100), strict=True):
        assert 1.0 - ours.student_tail(ours.student_quantile(p, nu), nu) == pytest.approx(
            p, abs=1e-12
        )


def test_what_is_no_probability_is_refused() -> None:
    for wrong in (0.0, 1.0, -0.1, math.nan):
        with pytest.raises(ArgumentError, match="between 0 and 1"):
            ours.student_quantile(wrong, 3.0)
    with pytest.raises(ArgumentError, match="degrees_of_freedom must be positive"):
        ours.student_tail(1.0, 0.0)


@pytest.mark.parametrize("chance", [1e-9, 1e-3, 0.05, 0.3173, 0.9])
def test_a_normal_number_exceeds_this_size_on_either_side(chance: float) -> None:
    size = ours.two_sided_quantile(chance)
    assert 2.0 * stats.norm.sf(size) == pytest.approx(chance, rel=1e-6)


@pytest.mark.parametrize("chance", [Fraction(1, 50), Fraction(1, 3), Fraction(9, 10)])
def test_a_binomial_tail_is_the_sum_of_its_terms(chance: Fraction) -> None:
    for of in (1, 7, 30):
        terms = [math.comb(of, k) * chance**k * (1 - chance) ** (of - k) for k in range(of + 1)]
        for count in range(of + 1):
            told = ours.binomial_tail(count, of, float(chance))
            assert told == pytest.approx(float(sum(terms[count:])), rel=1e-9)
    assert [ours.binomial_tail(3, 3, p) for p in (0.0, 1.0)] == [0.0, 1.0]


def test_the_functions_of_gamma_are_scipys() -> None:
    x = np.array([0.05, 0.5, 1.0, 3.7, 20.0, 400.0])
    np.testing.assert_allclose(ours.digamma(x), special.digamma(x), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(ours.trigamma(x), special.polygamma(1, x), rtol=1e-11)
    np.testing.assert_allclose(ours.trigamma_inverse(ours.trigamma(x)), x, rtol=1e-9)
