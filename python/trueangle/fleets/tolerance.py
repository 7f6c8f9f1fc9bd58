"""Tolerance limits: what bounds a share of all units, with a confidence."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.distributions import chi_squared_tail, normal_quantile, normal_tail
from ..support.plainresult import AngleOrNaN

#: Nodes of Gauss and Legendre's rule on each of the pieces of an integral.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)

#: Standard deviations beyond which the normal density is nothing to rounding.
_FAR: Final = 9.0


class Tolerance(NamedTuple):
    """A bound of the peak-to-peak of a share of all units.

    ``factor`` is that of the standard deviations of the logarithms, None where the bound rests on
    ranks (``method`` ``"wilks"``); ``peak_to_peak`` is in the unit of the fleet's period.
    """

    share: float
    confidence: float
    factor: float | None
    method: str
    peak_to_peak: AngleOrNaN
    left: AngleOrNaN


@told_kinds
def tolerance_factor(n: int, share: float, confidence: float, sides: int = 2) -> float:
    """Exact factor k of normal tolerance limits ``x̄ ± k s`` (or one of them).

    Two-sided, with Z the deviation of the mean and R(z) the half width that holds the share
    about it,

    ::

        ∫ P(χ²_{n-1} > (n-1) R(z)² / k²) φ(z) dz = γ,
        Φ(z/√n + R) - Φ(z/√n - R) = p;

    one-sided ``k = t'_{n-1,γ}(√n z_p) / √n`` of the noncentral t distribution.

    Parameters
    ----------
    n : int
        Units, two at least.
    share, confidence : float
        Between 0 and 1.
    sides : {1, 2}

    Returns
    -------
    float

    Raises
    ------
    ArgumentError

    Notes
    -----
    By quadrature, to 1e-9 (Howe's approximation of the NIST handbook 7.2.6.3 differs in the
    third decimal).

    Examples
    --------
    >>> round(tolerance_factor(10, 0.95, 0.95), 3), round(tolerance_factor(43, 0.9, 0.99, 1), 4)
    (3.393, 1.874)
    """
    if n < 2:
        raise ArgumentError(f"n must be 2 at least, got {n}")
    check_shares(share, confidence, sides)
    low, high = 1e-6, 1.0
    chance = _one_sided if sides == 1 else _two_sided
    where, weights = _normal_rule(n, share, sides)
    while chance(high, n, share, where, weights) < confidence:
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        if chance(middle, n, share, where, weights) < confidence:
            low = middle
        else:
            high = middle
        if high - low <= 1e-12 * high:
            break
    return 0.5 * (low + high)


def _normal_rule(n: int, share: float, sides: int) -> tuple[Array, Array]:
    """Places of the mean's deviation (or half widths about them), and weights of the density."""
    edges = np.linspace(-_FAR, _FAR, 24 + 1)
    half = 0.5 * np.diff(edges)[:, None]
    places = (half * (_NODES + 1.0) + edges[:-1, None]).ravel()
    weights = (half * _WEIGHTS).ravel() * np.exp(-0.5 * places**2) / math.sqrt(2.0 * math.pi)
    if sides == 1:
        return places, weights
    kept = weights > 1e-16
    return np.array([_half_width(z / math.sqrt(n), share) for z in places[kept]]), weights[kept]


def _half_width(centre: float, share: float) -> float:
    """R with Phi(centre + R) - Phi(centre - R) = share."""
    low, high = 0.0, abs(centre) + 12.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if normal_tail(-centre - middle) - normal_tail(middle - centre) < share:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _two_sided(k: float, n: int, share: float, widths: Array, weights: Array) -> float:
    scaled = (n - 1.0) * (widths / k) ** 2
    tails = [chi_squared_tail(x, n - 1.0) for x in scaled.tolist()]
    return float(weights @ np.array(tails))


def _one_sided(k: float, n: int, share: float, places: Array, weights: Array) -> float:
    """P(mean + k s > quantile): given the mean, the chi-squared tail of what s must exceed."""
    wanted = (normal_quantile(share) - places / math.sqrt(n)) / k
    found = 0.0
    for need, weight in zip(wanted.tolist(), weights.tolist(), strict=True):
        found += weight * (1.0 if need <= 0.0 else chi_squared_tail((n - 1.0) * need**2, n - 1.0))
    return found


@told_kinds
def wilks_units(share: float, confidence: float, sides: int = 2) -> int:
    """Fewest units whose extremes bound a share of all, for any distribution.

    One-sided ``1 - pⁿ ≥ γ``, two-sided ``1 - n pⁿ⁻¹ + (n-1) pⁿ ≥ γ``
    (Wilks 1941).

    Raises
    ------
    ArgumentError

    Examples
    --------
    >>> wilks_units(0.95, 0.95, 1), wilks_units(0.95, 0.95, 2)
    (59, 93)
    """
    check_shares(share, confidence, sides)
    doubt = 1.0 - confidence
    n = max(sides, math.ceil(math.log(doubt) / math.log(share) - 1e-9))
    while sides == 2 and n * share ** (n - 1) - (n - 1) * share**n > doubt:
        n += 1
    return n


def check_shares(share: float, confidence: float, sides: int = 1) -> None:
    """Refuse what is no share of units, no confidence, or neither one side nor two.

    Raises
    ------
    ArgumentError
        Names the argument.
    """
    if sides not in (1, 2):
        raise ArgumentError(f"sides must be 1 or 2, got {sides!r}")
    for name, value in (("share", share), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise ArgumentError(f"{name} must lie between 0 and 1, got {value!r}")


def tolerance_of(sizes: Array, left: Array, share: float, confidence: float) -> Tolerance:
    """The bound of a share of units: by ranks where these suffice, else by normal logarithms.

    Peak-to-peaks are positive and skew: their logarithms are nearer to a normal distribution.
    """
    n = len(sizes)
    if n >= wilks_units(share, confidence, 1):
        # The lowest rank r whose bound holds: P(Binomial(n, share) <= r - 1) >= confidence.
        rank = _rank(n, share, confidence)
        bounds = [float(np.sort(values)[rank - 1]) for values in (sizes, left)]
        return Tolerance(share, confidence, None, "wilks", *bounds)
    if n < 2:
        return Tolerance(share, confidence, None, "none", math.nan, math.nan)
    factor = tolerance_factor(n, share, confidence, 1)
    bounds = []
    for values in (sizes, left):
        logs = np.log(np.maximum(values, 1e-300))
        with np.errstate(over="ignore"):
            bounds.append(float(np.exp(logs.mean() + factor * logs.std(ddof=1))))
    return Tolerance(share, confidence, factor, "normal", *bounds)


def _rank(n: int, share: float, confidence: float) -> int:
    """The lowest rank of n values that bounds the share from above with this confidence."""
    below, term = 0.0, math.log1p(-share) * n
    for i in range(n):
        below += math.exp(term)
        if below >= confidence:
            return i + 1
        term += math.log((n - i) / (i + 1.0)) + math.log(share) - math.log1p(-share)
    return n
