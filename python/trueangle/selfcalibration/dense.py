"""Patterns jointly with nuisances: zeros of runs, ratios, couplings that change with clamping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .correlation import WHITE, Correlation, correlation_of, lag_pairs, lag_sums
from .densetriangle import (
    DenseRows,
    SolvedTriangle,
    possible_variances,
    solved_triangle,
    triangle_of,
)
from .projected import NOT_SEEN, Projected, Unknown, combinations

#: Readings from which the correlation of residuals is estimated, and blocks that are averaged.
_BLOCKS: Final = 40

#: Most fits, each at the angles corrected by the one before; fits whose angles are not corrected
#: yet; and the change, in standard errors, below which coefficients have converged.
_AT_FIRST: Final = 2


@dataclass(frozen=True)
class DenseFit:
    """Patterns, nuisances and the residual."""

    projected: Projected
    patterns: Array
    nuisances: Array
    nuisance_std: Array
    random_variance: float
    """Variance of a random term relative to the noise."""
    residuals: Array
    covariance: Array
    """Of the patterns; includes the correlation of the noise and the random term."""
    correlation: Correlation
    triangle: Array
    """Of nuisances, patterns and target: all that fits of fewer columns need."""

    @property
    def correlated(self) -> bool:
        """Whether neighbouring residuals correlate."""
        return not self.correlation.is_white

    @property
    def notes(self) -> list[str]:
        """What its standard errors are of, where they are not those of independent readings."""
        told = "neighbouring residuals correlate: standard errors allow for it"
        return [told] if self.correlated else []


def fit_dense(
    parts: Sequence[DenseRows],
    columns: Sequence[Unknown],
    random: Sequence[int] = (),
    freedom_lost: float = 0.0,
    floor: float = NOT_SEEN,
) -> DenseFit:
    """Least squares by orthogonal triangles, the nuisances eliminated first.

    ``random`` nuisances differ at random from run to run, with one variance. Coefficients are
    averaged over the evidence of this variance; their covariance includes its uncertainty.
    Where neighbouring residuals are correlated it is estimated from whitened rows.
    ``freedom_lost`` counts rows without information of their own (differences to a mean).
    Combinations of patterns that retain less than ``floor`` count as not identifiable, for any
    the random nuisances hide of the others.
    """
    p, m = parts[0].nuisances.shape[1], len(columns)
    triangle = triangle_of(parts)
    count = sum(part.target.size for part in parts) - freedom_lost
    alone = np.sum([part.squares for part in parts], axis=0)
    alone = np.where(alone > 1e-12 * max(float(alone.max(initial=0.0)), 1e-300), alone, 0.0)

    plain = solved_triangle(triangle, p, m, random, 0.0)
    scale, _, vectors, _ = combinations(plain.information, alone, floor)
    seen = scale[:, None] * vectors
    freedom = max(count - (p - len(random) + seen.shape[1]), 1.0)

    def projected_at(solved: SolvedTriangle, design: Projected | None) -> Projected:
        return Projected(
            tuple(columns),
            solved.information,
            solved.root.T @ solved.right,
            alone,
            solved.squares(seen) / freedom,
            freedom,
            floor,
            design,
        )

    variance, solved, correlation = 0.0, plain, WHITE
    design = projected_at(plain, None) if len(random) else None
    possible: list[tuple[float, float]] = []
    while True:
        if len(random):
            asked, independent = triangle, count
            if not correlation.is_white:
                rows = [part.whitened(correlation) for part in parts]
                asked = triangle_of(rows)
                independent = sum(part.target.size for part in rows) - freedom_lost
            possible = possible_variances(asked, p, seen, random, independent)
            # The unit is the whole noise of a reading, including what neighbours predict.
            possible = [(v / correlation.level, chance) for v, chance in possible]
            variance = max(possible, key=lambda pair: pair[1])[0]
            solved = solved_triangle(triangle, p, m, random, variance)
        projected = projected_at(solved, design)
        noise, patterns = projected.variance, projected.solution
        nuisances = solved.inverse @ (solved.corner_right - solved.beside @ patterns)
        residuals = np.concatenate(
            [q.target - q.patterns @ patterns - q.nuisances @ nuisances for q in parts]
        )
        bread = spread = _bread(solved, projected)
        before, correlation = correlation, WHITE
        # Readings from which the correlation of residuals is estimated.
        if residuals.size > 60 and float(residuals @ residuals) > 0.0:
            series = DenseSeries(parts, bread, freedom_lost)
            correlation = correlation_of(series.of(residuals), series.absorbed)
            if not correlation.is_white:
                spread, own = series.with_correlation(correlation, freedom)
                projected = replace(projected, variance=noise * freedom / own)
        # Where readings are correlated, the first variance was estimated as if they were white.
        if correlation.is_white or not before.is_white or not len(random):
            break
    covariance = projected.variance * spread[p:, p:]
    if len(possible) > 1:
        others = [
            (projected_at(solved_triangle(triangle, p, m, random, v), design), chance)
            for v, chance in possible
        ]
        patterns = np.sum([chance * one.solution for one, chance in others], axis=0)
        wider = [chance * one.covariance for one, chance in others]
        wider += [
            chance * np.outer(one.solution - patterns, one.solution - patterns)
            for one, chance in others
        ]
        covariance = covariance + np.sum(wider, axis=0) - noise * projected.inverse
        nuisances = solved.inverse @ (solved.corner_right - solved.beside @ patterns)
    return DenseFit(
        projected,
        patterns,
        nuisances,
        np.sqrt(np.maximum(projected.variance * np.diagonal(spread)[:p], 0.0)),
        variance,
        residuals,
        covariance,
        correlation,
        triangle,
    )


def _bread(solved: SolvedTriangle, projected: Projected) -> Array:
    """Of nuisances and patterns: their covariance in white noise of unit variance."""
    through = solved.inverse @ solved.beside  # what the nuisances take of the patterns
    mixed = -through @ projected.inverse
    corner = solved.inverse @ solved.inverse.T - mixed @ through.T
    return np.block([[corner, mixed], [mixed.T, projected.inverse]])


def dense_fixed_point(fit_at: Callable[[Array, bool], DenseFit], size: int) -> DenseFit:
    """The fit at the angles that its own patterns correct, starting without a correction.

    The second argument of ``fit_at`` is whether the angles are corrected: until then the residual
    is not noise, and random nuisances cannot be estimated from it.
    """
    coefficients = np.zeros(size)
    # Each at the angles corrected by the one before.
    for number in range(8):
        fit = fit_at(coefficients, number >= _AT_FIRST)
        # A hardly identifiable combination is noise of any size: it corrects no angle.
        found = np.where(fit.projected.told, fit.patterns, 0.0)
        std = np.sqrt(np.maximum(np.diagonal(fit.covariance), 1e-300))
        still = np.abs((found - coefficients) / std).max(initial=0.0) < 0.02
        coefficients = found
        if still and number >= _AT_FIRST:
            break
    return fit


def patterns_apart(
    parts: Sequence[DenseRows],
    groups: Sequence[NDArray[np.bool_]],
    columns: Sequence[Unknown],
    freedom_lost: float = 0.0,
) -> DenseFit:
    """One fit of a pattern for the rows of a group, and one for the others, each with nuisances.

    All readings in one: noise that outlasts a group is in both patterns, and in their covariance.
    """
    split = []
    for part, group in zip(parts, groups, strict=True):
        here, there = group[:, None], ~group[:, None]
        share = float(group.mean())
        split.append(
            DenseRows(
                np.concatenate([part.patterns * here, part.patterns * there], axis=1),
                np.concatenate([part.nuisances * here, part.nuisances * there], axis=1),
                part.target,
                np.concatenate([part.squares * share, part.squares * (1.0 - share)]),
                part.series,
            )
        )
    both = [c._replace(source=f"{c.source}, part {i}") for i in (1, 2) for c in columns]
    return fit_dense(split, both, (), freedom_lost)


def low_frequency_inflation(fit: DenseFit) -> float:
    """Variance of slow patterns relative to independent residuals; 1 at least.

    The greater of two estimates: from the correlation of neighbours, and from means over blocks
    (less what slow patterns explain of them), for correlation over longer times.
    """
    if not fit.correlated:
        return 1.0
    left = fit.residuals
    size = max(1, left.size // _BLOCKS)
    means = left[: _BLOCKS * size].reshape(_BLOCKS, size).mean(axis=1)
    free = max(_BLOCKS - fit.patterns.size, _BLOCKS // 2)
    blocks = size * float(means @ means) / free / fit.projected.variance
    return max(1.0, blocks, float(fit.correlation.spectrum(np.zeros(1))[0]))


class DenseSeries:
    """Rows of nuisances and patterns Z, series by series, and what a fit makes of their noise.

    ``bread`` is ``(Z'Z + L)^-1`` with the prior L of random nuisances.
    """

    def __init__(self, parts: Sequence[DenseRows], bread: Array, freedom_lost: float) -> None:
        self.bread = bread
        self.rows = [
            one
            for part in parts
            for one in np.split(
                np.concatenate([part.nuisances, part.patterns], axis=1), part.series
            )
        ]
        self.edges = np.cumsum([len(one) for one in self.rows])
        self.common = freedom_lost / float(self.edges[-1])
        """Share of the noise that differences to a mean have lost."""

    def of(self, values: Array) -> list[Array]:
        """Values of all rows, series by series."""
        return np.split(values, self.edges[:-1])

    def absorbed(self, correlation: Correlation, most: int) -> Array:
        """Sums over lags of ``H + H D + D H - H D H``, ``H = Z (Z'Z + L)^-1 Z'``, ``D = R - I``."""
        found = np.zeros(most + 1)
        pairs = lag_pairs([len(rows) for rows in self.rows], most)
        middle = self._middle(correlation)
        for rows in self.rows:
            held = rows @ self.bread
            found += lag_sums(held, rows, most)
            if correlation.is_white:
                continue
            more = correlation.times(rows) - rows
            found += lag_sums(held, more, most) + lag_sums(more, held, most)
            found -= lag_sums(held @ middle, held, most)
        return np.asarray(found + self.common * pairs * correlation.over_lags(most + 1))

    def with_correlation(self, correlation: Correlation, freedom: float) -> tuple[Array, float]:
        """Covariance of all coefficients over the noise's variance, and the degrees of freedom.

        ::

            B + B Z'D Z B,    n - tr[B Z'R Z],    B = (Z'Z + L)^-1
        """
        middle = self._middle(correlation)
        spread = self.bread + self.bread @ middle @ self.bread
        return spread, max(freedom - float(np.einsum("ij,ji->", self.bread, middle)), 1.0)

    def _middle(self, correlation: Correlation) -> Array:
        """``Z'D Z``."""
        found = np.zeros_like(self.bread)
        for rows in self.rows:
            if not correlation.is_white:
                found += rows.T @ (correlation.times(rows) - rows)
        return found
