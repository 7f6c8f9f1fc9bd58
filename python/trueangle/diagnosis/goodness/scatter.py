"""What the noise is like: correlation, tails, bursts, repeats, the simulation's own sigma."""

from __future__ import annotations

import numpy as np

from ...support.arrays import Array, distinct
from ...support.distributions import chi_squared_tail, f_tail, normal_tail
from .evidence import Evidence
from .leftover import Leftover
from .noise import Noise

#: Name of the test of the noise against the sigma of the simulation.
AGAINST_STATED = "noise against the simulation's"

#: Degrees within which two readings were taken at the same place.
SAME_PLACE = 1e-3

#: Share of the places that each pass must come by for repeats to be meant: readings whose
#: angles coincide because they were rounded are no repeats.
MEANT = 0.8

#: Readings per place and pass at most: a joint at rest repeats nothing.
AT_REST = 1.5

#: Lags over which bursts are looked for; readings needed for tails and bursts.
LAGS, LEAST_READINGS = 5, 50


def scatter_tests(left: Leftover, noise: Noise, sigma: float | None = None) -> list[Evidence]:
    """Tests that describe the noise and decide nothing.

    Parameters
    ----------
    left : Leftover
    noise : Noise
    sigma : float, optional
        Noise of one reading that the simulation states.
    """
    found = [_correlation(noise)]
    e = _whitened_residual(left, noise)
    if e.size >= LEAST_READINGS and np.ptp(e) > 0.0:
        found += [_tails(e), _bursts(e)]
    same = scatter_of_repeats(left)
    if same is not None and same[0] > 0.0:
        value, freedom = same
        ratio = noise.sigma / value
        rho = noise.correlation
        shrink = (1.0 - rho**2) / (1.0 + rho**2)
        found.append(
            Evidence(
                "noise against repeats",
                ratio,
                f_tail(ratio**2, max(noise.freedom * shrink, 1.0), max(freedom * shrink, 1.0)),
                f"the noise is {ratio:.3g} times the scatter of readings repeated at one place",
                decides=False,
            )
        )
    if sigma:
        found.append(_against_stated(e, noise, sigma))
    return found


def _whitened_residual(left: Leftover, noise: Noise) -> Array:
    """Innovations of the residual under the noise's correlation, over their deviation."""
    e = left.centred(left.bounds)
    rho = noise.correlation
    if rho:
        out = e.copy()
        out[1:] -= rho * e[:-1]
        first = [start for start, _ in left.bounds]
        out[first] = e[first] * np.sqrt(1.0 - rho**2)
        e = out
    return np.asarray(e / max(float(np.sqrt(np.mean(e**2))), 1e-300))


def scatter_of_repeats(left: Leftover) -> tuple[float, float] | None:
    """Scatter of readings at places that runs come back to on purpose, and its freedom.

    None where no places were repeated, or angles coincide by rounding alone.
    """
    place = np.round(np.mod(np.degrees(left.theta), 360.0) / SAME_PLACE).astype(np.int64)
    place %= round(360.0 / SAME_PLACE)
    turn = (np.diff(left.run) != 0) | (np.diff(left.direction) != 0.0)
    passed = np.concatenate([[0], np.cumsum(turn)])
    places, index = np.unique(place, return_inverse=True)
    if places.size * 2 > len(left):
        return None
    shares, dense = [], []
    for k in distinct(passed):
        inside = index[passed == k]
        own = distinct(inside)
        span = places[(places >= places[own.min()]) & (places <= places[own.max()])].size
        shares.append(own.size / max(span, 1))
        dense.append(inside.size / own.size)
    if float(np.median(shares)) < MEANT or float(np.median(dense)) > AT_REST:
        return None
    key = index * 3 + left.direction.astype(np.int64) + 1
    _, group, count = np.unique(key, return_inverse=True, return_counts=True)
    # A run's own zero is no scatter of repeats.
    e = left.centred(left.bounds)
    freedom = float((count - 1).sum()) - (len(left.bounds) - 1)
    if freedom < 0.25 * len(left):
        return None
    mean = np.bincount(group, weights=e) / count
    return float(np.sqrt(np.sum((e - mean[group]) ** 2) / freedom)), freedom


def _correlation(noise: Noise) -> Evidence:
    said = (
        f"neighbouring readings share noise: correlation {noise.correlation:.2f} +- {noise.std:.2f}"
        if noise.correlation
        else "neighbouring readings are independent"
    )
    p = normal_tail(noise.root)
    return Evidence("correlation", noise.correlation, p, said, decides=False)


def normal_kurtosis(kurtosis: float, n: float) -> float:
    """Kurtosis of n independent values made a standard normal: Anscombe and Glynn (1983).

    Examples
    --------
    >>> round(normal_kurtosis(3.0, 1000.0), 2), round(normal_kurtosis(4.0, 1000.0), 1)
    (0.11, 4.6)
    """
    mean = 3.0 * (n - 1.0) / (n + 1.0)
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (kurtosis - mean) / np.sqrt(variance)
    skew = (
        6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
        * np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)))
    )  # fmt: skip
    a = 6.0 + 8.0 / skew * (2.0 / skew + np.sqrt(1.0 + 4.0 / skew**2))
    denominator = 1.0 + x * np.sqrt(2.0 / (a - 4.0))
    third = np.sign(denominator) * (np.abs((1.0 - 2.0 / a) / denominator)) ** (1.0 / 3.0)
    return float((1.0 - 2.0 / (9.0 * a) - third) / np.sqrt(2.0 / (9.0 * a)))


def _tails(e: Array) -> Evidence:
    d = e - e.mean()
    kurtosis = float(np.mean(d**4) / np.mean(d**2) ** 2)
    z = normal_kurtosis(kurtosis, float(e.size))
    p = 2.0 * normal_tail(abs(z))
    kind = "heavier" if z > 0.0 else "lighter"
    says = f"the tails are {kind} than a normal distribution's" if p < 0.01 else "normal tails"
    return Evidence("tails", kurtosis, p, says, decides=False)


def _bursts(e: Array) -> Evidence:
    """Correlation of the ranks of sizes over a few lags: large readings come together."""
    n = e.size
    rank = np.empty(n)
    rank[np.argsort(np.abs(e), kind="stable")] = np.arange(n)
    rank = (rank - rank.mean()) / rank.std()
    total = sum(float(rank[k:] @ rank[:-k]) ** 2 / (n - k) for k in range(1, LAGS + 1))
    p = chi_squared_tail(total, float(LAGS))
    says = "large readings come together" if p < 0.01 else "large readings come singly"
    return Evidence("bursts", total, p, says, decides=False)


def _against_stated(e: Array, noise: Noise, stated: float) -> Evidence:
    """The noise found against the one that the simulation states."""
    ratio = noise.sigma / stated
    kurtosis = max(float(np.mean(e**4)), 1.5)
    rho = noise.correlation
    spread = np.sqrt((kurtosis - 1.0) * (1.0 + rho**2) / (1.0 - rho**2) / max(noise.freedom, 1.0))
    z = 2.0 * float(np.log(ratio)) / float(spread) if ratio > 0.0 else -np.inf
    return Evidence(
        AGAINST_STATED,
        ratio,
        2.0 * normal_tail(abs(z)),
        f"the noise of one reading is {noise.sigma:.3g} arcsec where the simulation states "
        f"{stated:.3g} arcsec",
        decides=False,
    )
