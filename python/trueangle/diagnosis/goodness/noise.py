"""The noise of one reading and its correlation, for any pattern.

Residuals of a fitted account misstate the correlation: what repeats at a place looks
like it, and what the fit removes lowers it. Here the readings of each run are

::

    y = Xβ + n,    corr(n_i, n_j) = ρ^(|i - j|),

with X a mean per run and a flexible pattern of the angle, common and by direction, and rho
maximises the restricted likelihood (Patterson and Thompson 1971), in which the coefficients
cost nothing:

::

    -2 l = (n - p) ln RSS(ρ) - R ln(1 - ρ²) + ln|Xᵀ V⁻¹ X|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...effects.search import golden_maximum
from ...support.arrays import Array
from .leftover import Leftover

#: Orders of the flexible pattern at most, and readings per column at least.
MOST_ORDERS, READINGS_PER_COLUMN = 12, 12

#: Readings used at most: whole runs, from the first on.
MOST_READINGS = 12_000

#: Robust standard deviations to which residuals are clipped.
CLIP = 4.0

#: Correlations that are tried first; the best is refined by parabolas.
TRIALS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.975, 0.99)

#: Correlations below none are looked for down to minus this one.
BELOW = 0.3

#: Share of the power of the strongest combination of columns from which another one counts.
DISTINCT = 1e-6

#: Half the deviance that a correlation must bring to be distinguished from none: 4 standard errors.
TOLD = 16.0


@dataclass(frozen=True)
class Noise:
    """Noise of readings.

    Attributes
    ----------
    sigma : float
        Standard deviation of one reading.
    correlation : float
        Between neighbours in a run; 0 where it is not distinguished from none.
    std : float
        Standard error of the correlation.
    deviance : float
        2 ln of the restricted likelihood ratio against white noise.
    freedom : float
        Readings less coefficients.
    root : float
        Root of the likelihood ratio with the sign of the correlation: standard normal where
        there is none.
    """

    sigma: float
    correlation: float
    std: float
    deviance: float
    freedom: float
    root: float


def estimate_noise(left: Leftover) -> Noise:
    """Standard deviation and correlation of the noise by restricted likelihood.

    Parameters
    ----------
    left : Leftover
        The residual of the readings; a pattern may still be in it.

    Returns
    -------
    Noise
        About 30 ms for 10 000 readings.
    """
    bounds = _some(left.bounds)
    stop = bounds[-1][1]
    e = left.residual[:stop]
    # Outliers would hide a correlation; what is slow keeps its size.
    e = _without_spikes(e, bounds)
    columns = left.kept.get("pattern")
    if columns is None:
        pattern = _centred(_pattern(left, stop, len(bounds)), bounds)
        columns = left.kept["pattern"] = _PatternProducts(pattern, bounds)
    means = len(bounds)
    sums = _Sums(columns, _centred(e[:, None], bounds)[:, 0])
    trials = np.array(TRIALS)
    values = np.array([sums.deviance(r, means) for r in trials])
    k = int(np.argmin(values))
    # Less than none, too: noise alone is as often below as above, and its p value even.
    low, high = (trials[k - 1] if k else -BELOW), trials[min(k + 1, trials.size - 1)]
    rho, best = golden_maximum(lambda r: -sums.deviance(r, means), float(low), float(high), 16)
    value = -best
    if value > values[k]:
        rho, value = float(trials[k]), float(values[k])
    root = float(np.copysign(np.sqrt(max(float(values[0] - value), 0.0)), rho))
    if rho < 0.0:
        rho, value = 0.0, float(values[0])
    step = min(0.02, 0.5 * (1.0 - rho))
    # Alike to both sides, of no correlation too: there the valley may lie below none.
    sides = sums.deviance(rho + step, means) + sums.deviance(rho - step, means)
    bend = (sides - 2.0 * value) / step**2
    std = float(np.sqrt(2.0 / bend)) if bend > 0.0 else 1.0 / np.sqrt(max(stop, 1))
    gained = float(values[0] - value)
    if gained < TOLD:
        rho = 0.0
    rss, freedom = sums.fitted(rho, means)
    innovation = rss / max(freedom, 1.0)
    return Noise(
        float(np.sqrt(innovation / (1.0 - rho**2))),
        rho,
        std,
        max(gained, 0.0),
        float(freedom),
        root,
    )


def _some(bounds: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The first runs, as many as are needed; of a long first run the beginning."""
    kept: list[tuple[int, int]] = []
    for start, stop in bounds:
        if start >= MOST_READINGS:
            break
        kept.append((start, min(stop, start + MOST_READINGS)))
        if stop > MOST_READINGS:
            break
    return kept


def _without_spikes(e: Array, bounds: list[tuple[int, int]]) -> Array:
    """Readings far from the mean of their neighbours in the run put back to it."""
    if e.size < 3:
        return e
    first, last = (
        np.array(ends) - shift
        for ends, shift in zip(zip(*bounds, strict=True), (0, 1), strict=True)
    )
    before, after = np.roll(e, 1), np.roll(e, -1)
    # At either end of a run its only neighbour: another run has another zero.
    before[first] = e[np.minimum(first + 1, last)]
    after[last] = e[np.maximum(last - 1, first)]
    beside = 0.5 * (before + after)
    away = e - beside
    limit = CLIP * 1.4826 * float(np.median(np.abs(away)))
    return np.where(np.abs(away) > limit, beside + np.clip(away, -limit, limit), e)


def _pattern(left: Leftover, n: int, runs: int) -> Array:
    moving = left.direction[:n]
    both = bool(np.ptp(moving[moving != 0.0]) > 0.0) if np.any(moving != 0.0) else False
    width = 4 if both else 2
    most = max((n // READINGS_PER_COLUMN - runs) // width, 0)
    orders = min(most, MOST_ORDERS)
    step = 1.0 if left.turns > 0.9 else 1.0 / max(2.0 * left.turns, 1e-3)
    angle = np.outer(left.theta[:n], step * np.arange(1, orders + 1))
    columns = [np.cos(angle), np.sin(angle)]
    if both:
        d = moving[:, None]
        columns += [d, d * columns[0], d * columns[1]]
    return np.hstack(columns) if columns[0].size or both else np.zeros((n, 0))


def _centred(x: Array, bounds: list[tuple[int, int]]) -> Array:
    out = x.copy()
    for a, b in bounds:
        out[a:b] -= out[a:b].mean(axis=0)
    return out


class _PatternProducts:
    """The flexible pattern with its products: of readings, of inner ones, of neighbours."""

    def __init__(self, pattern: Array, bounds: list[tuple[int, int]]) -> None:
        self.x = x = _independent(pattern)
        self.runs = len(bounds)
        first = np.array([a for a, _ in bounds])
        last = np.array([b - 1 for _, b in bounds])
        self.ends = np.concatenate([first, last])
        self.closing = last[:-1]
        self.same = x.T @ x
        self.inner = self.same - x[self.ends].T @ x[self.ends]
        cross = x[1:].T @ x[:-1] - x[self.closing + 1].T @ x[self.closing]
        self.cross = cross + cross.T


class _Sums:
    """Products from which RSS and determinant follow for every correlation.

    With the run's mean taken out beforehand: for correlated noise the mean of the readings
    is not quite the best estimate of the run's zero, by an amount that ends matter for only.
    """

    def __init__(self, columns: _PatternProducts, e: Array) -> None:
        x, ends, closing = columns.x, columns.ends, columns.closing
        self.runs, self.n = columns.runs, e.size
        inner = e.copy()
        inner[ends] = 0.0
        # The neighbours of a reading in its run.
        beside = np.zeros_like(e)
        beside[1:] = e[:-1]
        beside[:-1] += e[1:]
        beside[closing] -= e[closing + 1]
        beside[closing + 1] -= e[closing]
        self.same = _bordered(columns.same, x, e, e)
        self.inner = _bordered(columns.inner, x, inner, e)
        self.cross = _bordered(columns.cross, x, beside, e)

    def products(self, rho: float) -> Array:
        """Products z' V^-1 z times the variance of one innovation."""
        return np.asarray(self.same + rho**2 * self.inner - rho * self.cross)

    def fitted(self, rho: float, means: int) -> tuple[float, float]:
        """RSS of the innovations and degrees of freedom."""
        m = self.products(rho)
        p = m.shape[0] - 1
        rest = float(m[p, p])
        if p:
            rest -= float(m[p, :p] @ np.linalg.solve(m[:p, :p], m[:p, p]))
        return max(rest, 1e-300), float(self.n - p - means)

    def deviance(self, rho: float, means: int) -> float:
        """-2 ln of the restricted likelihood, up to a constant."""
        m = self.products(rho)
        p = m.shape[0] - 1
        rss, freedom = self.fitted(rho, means)
        determinant = 0.0
        if p:
            determinant = float(np.linalg.slogdet(m[:p, :p])[1])
        # The means of the runs: 1' V^-1 1 is about n (1 - rho)^2 + 2 rho (1 - rho).
        per_run = self.n / self.runs
        zero = (1.0 - rho) * (per_run * (1.0 - rho) + 2.0 * rho)
        determinant += means * float(np.log(max(zero, 1e-300)))
        return float(freedom * np.log(rss) - self.runs * np.log1p(-(rho**2)) + determinant)


def _bordered(gram: Array, x: Array, mapped: Array, e: Array) -> Array:
    """Products of columns and of one more, which the noise maps to ``mapped``."""
    whole = np.empty((gram.shape[0] + 1, gram.shape[1] + 1))
    whole[:-1, :-1] = gram
    whole[-1, :-1] = whole[:-1, -1] = mapped @ x
    whole[-1, -1] = mapped @ e
    return whole


def _independent(x: Array) -> Array:
    """Columns of length 1 at right angles that span the same; without those that hardly differ.

    Over a part of a turn orders are nearly collinear, and their difference would be the
    rounding of the determinant.
    """
    if not x.shape[1]:
        return x
    scale = np.sqrt(np.maximum(np.einsum("ij,ij->j", x, x), 1e-300))
    values, vectors = np.linalg.eigh((x / scale).T @ (x / scale))
    kept = values > DISTINCT * values[-1]
    return np.asarray(x @ (vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]))
