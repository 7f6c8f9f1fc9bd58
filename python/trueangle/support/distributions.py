"""Tail probabilities and quantiles of the normal, Student, chi-squared and F distributions.

The installed package needs numpy alone, which has none of them. All use the two incomplete
functions, computed by the continued fraction or the series, whichever converges.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final

import numpy as np

from ..errors import ArgumentError, KindError
from .arrays import Array

#: Relative size of a step of a fraction or series that no longer counts: two roundings.
_NEGLIGIBLE: Final = 4e-16

#: Steps at most. Fractions take about sqrt(max(a, b)) of them: enough up to 1e10.
_MOST_STEPS: Final = 200_000


#: Replaces a zero denominator in a continued fraction (Lentz).
_TINY: Final = 1e-300

#: Degrees of freedom beyond which Student's distribution is the normal one to rounding.
_NORMAL_BEYOND: Final = 1e12


def normal_tail(x: float) -> float:
    """Probability ``P(Z > x)`` of the standard normal distribution.

    Examples
    --------
    >>> round(normal_tail(1.959963984540054), 12)
    0.025
    """
    return 0.5 * math.erfc(x / math.sqrt(2.0))


def normal_quantile(p: float) -> float:
    """The x with ``P(Z ≤ x) = p``; p inside (0, 1), relative accuracy 1e-15."""
    from statistics import NormalDist  # loads decimal and random: only where it is asked

    return NormalDist().inv_cdf(_probability(p))


def two_sided_quantile(chance: float) -> float:
    """The x with ``P(|Z| > x) = chance``: what a standard normal number exceeds in size."""
    return normal_quantile(1.0 - 0.5 * chance)


def student_tail(t: float, degrees_of_freedom: float) -> float:
    """Probability ``P(T_ν > t)`` of Student's distribution, to about 1e-13 relative.

    ::

        P(T_ν > t) = 1/2 I_{ν/(ν+t²)}(ν/2, 1/2),    t ≥ 0

    ν > 0 need not be whole; infinity gives the normal distribution.

    Examples
    --------
    >>> round(student_tail(2.228138851964939, 10), 9)
    0.025
    """
    nu = _positive("degrees_of_freedom", degrees_of_freedom)
    if nu > _NORMAL_BEYOND:
        return normal_tail(t)
    if math.isinf(t):
        return 0.0 if t > 0.0 else 1.0
    square = t * t
    if square < 1.0:  # by its complement, which does not round to 1 near t = 0
        return 0.5 - math.copysign(0.5 * _incomplete_beta(0.5, 0.5 * nu, square / (nu + square)), t)
    tail = 0.5 * _incomplete_beta(0.5 * nu, 0.5, nu / (nu + square))
    return tail if t >= 0.0 else 1.0 - tail


@lru_cache(maxsize=1024)
def student_quantile(p: float, degrees_of_freedom: float) -> float:
    """The t with P(T <= t) = p, from `student_tail`, relative accuracy 1e-12.

    Examples
    --------
    >>> round(student_quantile(0.97725, 8), 3), round(student_quantile(0.975, 1e9), 6)
    (2.366, 1.959964)
    """
    nu = _positive("degrees_of_freedom", degrees_of_freedom)
    if nu > _NORMAL_BEYOND:
        return normal_quantile(p)
    p = _probability(p)
    if p == 0.5:
        return 0.0
    smaller = min(p, 1.0 - p)
    t = _root(lambda x: student_tail(x, nu), smaller)
    return t if p > 0.5 else -t


def chi_squared_tail(x: float, degrees_of_freedom: float) -> float:
    """Probability ``P(χ²_ν > x) = Q(ν/2, x/2)``, to about 1e-13 relative.

    Examples
    --------
    >>> round(chi_squared_tail(5.991464547107979, 2), 12)
    0.05
    """
    nu = _positive("degrees_of_freedom", degrees_of_freedom)
    return incomplete_gamma_tail(0.5 * nu, 0.5 * x) if x > 0.0 else 1.0


def chi_squared_quantile(p: float, degrees_of_freedom: float) -> float:
    """The x with P(chi2 <= x) = p, from `chi_squared_tail`.

    Examples
    --------
    >>> round(chi_squared_quantile(0.95, 2), 9)
    5.991464547
    """
    upper = 1.0 - _probability(p)
    return _root(lambda x: chi_squared_tail(x, degrees_of_freedom), upper)


def f_tail(f: float, numerator: float, denominator: float) -> float:
    """Probability that Fisher's F with (d1, d2) degrees of freedom exceeds ``f``.

    ::

        P(F > f) = I_{d₂/(d₂+d₁f)}(d₂/2, d₁/2)

    An infinite denominator gives chi-squared over its degrees of freedom.

    Examples
    --------
    >>> round(f_tail(4.102821015, 2, 10), 9)
    0.05
    """
    d1, d2 = _positive("numerator", numerator), _positive("denominator", denominator)
    if f <= 0.0:
        return 1.0
    if math.isinf(f):
        return 0.0
    if d2 > _NORMAL_BEYOND:
        return chi_squared_tail(d1 * f, d1)
    return _incomplete_beta(0.5 * d2, 0.5 * d1, d2 / (d2 + d1 * f))


def f_quantile(p: float, numerator: float, denominator: float) -> float:
    """The f with P(F <= f) = p, from `f_tail`.

    Examples
    --------
    >>> round(f_quantile(0.95, 2, 10), 6)
    4.102821
    """
    upper = 1.0 - _probability(p)
    return _root(lambda x: f_tail(x, numerator, denominator), upper)


def binomial_tail(count: int, of: int, chance: float) -> float:
    """Probability of ``count`` or more of ``of`` independent trials.

    ::

        P(K ≥ k) = I_p(k, n - k + 1)

    Examples
    --------
    >>> round(binomial_tail(9, 10, 0.5), 10)  # (10 + 1) / 2^10
    0.0107421875
    """
    if count <= 0:
        return 1.0
    return _incomplete_beta(float(count), float(of - count + 1), chance)


def digamma(x: Array | float) -> Array:
    """Mean of ``log g`` of a gamma variable of shape x, by recurrence and series, to 1e-12."""
    steps, far = np.add.outer(np.arange(10.0), x), np.asarray(x) + 10.0
    square = 1.0 / (far * far)
    series = square * (1 / 12 - square * (1 / 120 - square * (1 / 252 - square / 240)))
    return np.asarray(np.log(far) - 0.5 / far - series - (1.0 / steps).sum(axis=0))


def trigamma(x: Array | float) -> Array:
    """Variance of ``log g`` of a gamma variable of shape x, by recurrence and series, to 1e-12."""
    steps, far = np.add.outer(np.arange(10.0), x), np.asarray(x) + 10.0
    square = 1.0 / (far * far)
    series = square * (1 / 6 - square * (1 / 30 - square * (1 / 42 - square / 30)))
    return np.asarray((1.0 / steps**2).sum(axis=0) + (1.0 + 0.5 / far + series) / far)


def trigamma_inverse(value: Array | float) -> Array:
    """The x from 1e-6 to 1e8 whose trigamma is ``value``, by halving."""
    low = np.full(np.shape(value), 1e-6)
    high = low * 1e14
    for _ in range(50):
        middle = np.sqrt(low * high)
        is_low = trigamma(middle) > value
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return np.sqrt(low * high)


def _incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function ``I_x(a, b)``, a, b > 0, 0 <= x <= 1.

    The continued fraction of DLMF 8.17.22, on the side where it converges fast.
    """
    if x <= 0.0 or x >= 1.0:
        return 0.0 if x <= 0.0 else 1.0
    front = math.exp(
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    )
    if x < (a + 1.0) / (a + b + 2.0):
        return front * _beta_fraction(a, b, x) / a
    return 1.0 - front * _beta_fraction(b, a, 1.0 - x) / b


def incomplete_gamma_tail(a: float, x: float) -> float:
    """Regularised upper incomplete gamma function ``Q(a, x)``, a > 0, x >= 0.

    By its series below a + 1 (DLMF 8.7.1) and its continued fraction above (8.9.2).
    """
    if x <= 0.0:
        return 1.0
    if math.isinf(x):
        return 0.0
    front = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1.0:
        return 1.0 - front * _gamma_series(a, x)
    return front * _gamma_fraction(a, x)


def _beta_fraction(a: float, b: float, x: float) -> float:
    """Lentz' evaluation of the continued fraction of the incomplete beta function."""
    c, d = 1.0, 1.0 / _nonzero(1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, _MOST_STEPS):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        d, c = 1.0 / _nonzero(1.0 + even * d), _nonzero(1.0 + even / c)
        value *= c * d
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        d, c = 1.0 / _nonzero(1.0 + odd * d), _nonzero(1.0 + odd / c)
        value *= c * d
        if abs(c * d - 1.0) < _NEGLIGIBLE:
            break
    return value


def _gamma_series(a: float, x: float) -> float:
    term = total = 1.0 / a
    for n in range(1, _MOST_STEPS):
        term *= x / (a + n)
        total += term
        if term < _NEGLIGIBLE * total:
            break
    return total


def _gamma_fraction(a: float, x: float) -> float:
    b = x + 1.0 - a
    c, d = 1.0 / _TINY, 1.0 / b
    value = d
    for n in range(1, _MOST_STEPS):
        numerator = -n * (n - a)
        b += 2.0
        d, c = 1.0 / _nonzero(numerator * d + b), _nonzero(b + numerator / c)
        value *= c * d
        if abs(c * d - 1.0) < _NEGLIGIBLE:
            break
    return value


def _root(tail: Callable[[float], float], probability: float) -> float:
    """The x > 0 beyond which a falling tail holds ``probability``, to rounding.

    False position on the logarithm, which is close to straight in the tail (Illinois' way of
    keeping both ends moving), after a bracket by doubling.
    """

    def missing(x: float) -> float:
        return math.log(max(tail(x), _TINY) / probability)

    low, high = 0.0, 1.0
    at_low, at_high = missing(0.0), missing(high)
    while at_high > 0.0 and high < 1e300:
        low, at_low, high = high, at_high, 2.0 * high
        at_high = missing(high)
    side = 0
    # Steps of the search for a quantile at most; ten are usual.
    for _ in range(200):
        x = (low * at_high - high * at_low) / (at_high - at_low)
        if not low < x < high:
            x = 0.5 * (low + high)
        if not low < x < high:
            break
        at = missing(x)
        if at == 0.0 or high - low <= _NEGLIGIBLE * x:
            return x
        if at > 0.0:
            low, at_low = x, at
            at_high *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            high, at_high = x, at
            at_low *= 0.5 if side < 0 else 1.0
            side = -1
        if abs(at) < _NEGLIGIBLE:
            return x
    return 0.5 * (low + high)


def _nonzero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


def _probability(p: float) -> float:
    if not 0.0 < p < 1.0:
        raise ArgumentError(f"a probability must lie between 0 and 1, got {p!r}")
    return p


def _positive(name: str, value: float) -> float:
    if not value > 0.0:
        raise ArgumentError(f"{name} must be positive, got {value!r}")
    return value


def random_numbers(seed: Any) -> np.random.Generator:
    """The random numbers of a seed, or the generator given.

    Raises
    ------
    KindError
        Neither.
    """
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise KindError(f"seed must be a whole number from 0, got {seed!r:.60}") from None
