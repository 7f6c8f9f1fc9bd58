"""Patterns beside plain nuisances: zeros of runs, ratios, couplings that change with clamping."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .correlation import WHITE, Correlation, correlation_of, lag_sums
from .projected import NOT_SEEN, Projected, Unknown

#: Variances of random terms that are tried, over that of their error in one run: from what the
#: readings do not show on, two a decade.
_SIZES: Final = np.logspace(-1.0, 12.0, 27)

#: Variances of less probability than this share of the most probable one's are left out.
_IMPROBABLE: Final = 1e-2

#: No variance at all: a prior so tight that the term is nothing.
_NO_VARIANCE: Final = 1e-24

#: Singular values of patterns below this share of the largest are not seen.
_RANK: Final = 1e-9

#: Readings from which residuals tell their correlation, and blocks whose means are looked at.
_TOLD: Final = 60
_BLOCKS: Final = 40

#: Fits of which each is made at the places that the one before corrects, at most, and the standard
#: errors within which coefficients no longer move; and those at places that are wrong.
_ROUNDS: Final = 8
_AT_FIRST: Final = 2
_STILL: Final = 0.02


@dataclass(frozen=True)
class DenseRows:
    """A part of the readings: patterns (n, m), nuisances (n, p), target (n)."""

    patterns: Array
    nuisances: Array
    target: Array
    alone: Array | None = None
    """Sum of squares of each pattern by itself, where the rows hold differences."""
    series: int = 1
    """Series of readings, of one length and one after the other, that the rows are."""

    @property
    def squares(self) -> Array:
        """Of each pattern with nothing beside it."""
        if self.alone is not None:
            return self.alone
        return np.asarray(np.einsum("ij,ij->j", self.patterns, self.patterns))


@dataclass(frozen=True)
class DenseFit:
    """Patterns, nuisances and what is left."""

    projected: Projected
    patterns: Array
    nuisances: Array
    nuisance_std: Array
    random_variance: float
    """Variance of a random term relative to the noise."""
    residuals: Array
    covariance: Array
    """Of the patterns; holds what is known of the correlation and of the random term."""
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

    ``random`` nuisances are drawn anew in every run, with one variance: coefficients are averages
    over what the evidence says of it, and their covariance holds how little few runs say.
    ``freedom_lost`` counts rows that say nothing of their own (differences to a mean); combinations
    of patterns of which less than ``floor`` is left count as not seen, whatever the random
    nuisances hide of the others.
    """
    p, m = parts[0].nuisances.shape[1], len(columns)
    triangle = _triangle(parts)
    count = sum(part.target.size for part in parts) - freedom_lost
    alone = np.sum([part.squares for part in parts], axis=0)
    alone = np.where(alone > 1e-12 * max(float(alone.max(initial=0.0)), 1e-300), alone, 0.0)

    def projected_at(solved: _Solved, design: Projected | None) -> Projected:
        return Projected(
            tuple(columns),
            solved.root.T @ solved.root,
            solved.root.T @ solved.right,
            alone,
            solved.noise,
            solved.freedom,
            floor,
            design,
        )

    variance, design = 0.0, None
    possible: list[tuple[float, float]] = []
    if len(random):
        possible = _possible_variances(triangle, p, m, random, count)
        variance = max(possible, key=lambda pair: pair[1])[0]
        design = projected_at(_solve(triangle, p, m, random, 0.0, count), None)
    solved = _solve(triangle, p, m, random, variance, count)
    projected = projected_at(solved, design)
    patterns = projected.solution
    nuisances = solved.inverse @ (solved.corner_right - solved.beside @ patterns)
    through = solved.inverse @ solved.beside  # what the nuisances take of the patterns
    residuals = np.concatenate(
        [q.target - q.patterns @ patterns - q.nuisances @ nuisances for q in parts]
    )
    bread = np.block(
        [
            [
                solved.inverse @ solved.inverse.T + through @ projected.inverse @ through.T,
                -through @ projected.inverse,
            ],
            [-projected.inverse @ through.T, projected.inverse],
        ]
    )
    correlation, spread = WHITE, bread
    if residuals.size > _TOLD and float(residuals @ residuals) > 0.0:
        series = _Series(parts, bread, freedom_lost)
        correlation = correlation_of(series.of(residuals), series.absorbed)
        if not correlation.is_white:
            spread, freedom = series.with_correlation(correlation, solved.freedom)
            projected = replace(projected, variance=projected.variance * solved.freedom / freedom)
    covariance = projected.variance * spread[p:, p:]
    if len(possible) > 1:
        others = [
            (projected_at(_solve(triangle, p, m, random, v, count), design), chance)
            for v, chance in possible
        ]
        patterns = np.sum([chance * one.solution for one, chance in others], axis=0)
        wider = [chance * one.covariance for one, chance in others]
        wider += [
            chance * np.outer(one.solution - patterns, one.solution - patterns)
            for one, chance in others
        ]
        covariance = covariance + np.sum(wider, axis=0) - solved.noise * projected.inverse
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


class _Series:
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
        pairs = np.zeros(most + 1)
        middle = self._middle(correlation)
        for rows in self.rows:
            pairs += np.maximum(len(rows) - np.arange(most + 1), 0)
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


def _triangle(parts: Iterable[DenseRows]) -> Array:
    """The triangle of ``[nuisances | patterns | target]``, part by part."""
    triangle: Array | None = None
    for part in parts:
        block = np.concatenate([part.nuisances, part.patterns, part.target[:, None]], axis=1)
        if triangle is not None:
            block = np.concatenate([triangle, block])
        triangle = np.asarray(np.linalg.qr(block, mode="r"))
    assert triangle is not None
    return triangle


@dataclass(frozen=True)
class _Solved:
    inverse: Array  # of the nuisances' triangle
    beside: Array  # nuisances against patterns
    corner_right: Array
    root: Array  # of the patterns
    right: Array
    noise: float
    freedom: float


def _solve(
    triangle: Array, p: int, m: int, random: Sequence[int], variance: float, count: float
) -> _Solved:
    # In units of their own deviation random nuisances have the prior 1, of any variance, and
    # of none the columns vanish: nothing is rounded at the size of a prior that is tight.
    scale = np.ones(p)
    scale[list(random)] = math.sqrt(variance)
    scaled = triangle.copy()
    scaled[:, :p] *= scale
    prior = np.zeros((len(random), triangle.shape[1]))
    prior[np.arange(len(random)), list(random)] = 1.0
    r: Array = np.asarray(np.linalg.qr(np.concatenate([scaled, prior]), mode="r"))
    root, right, left = r[p : p + m, p : p + m], r[p : p + m, -1:], r[p + m :, -1]
    # Patterns that nothing shows leave the sum of squares as it is: pseudo-inverse.
    seen, lost = _split(root, right)
    freedom = max(count - (p - len(random) + seen.size), 1.0)
    squares = float(left @ left) + float(np.sum(lost**2))
    inverse: Array = np.asarray(np.linalg.pinv(r[:p, :p], 1e-12), dtype=np.float64)
    return _Solved(
        scale[:, None] * inverse,
        r[:p, p : p + m],
        r[:p, -1],
        root,
        right[:, 0],
        squares / freedom,
        freedom,
    )


def _split(root: Array, right: Array) -> tuple[Array, Array]:
    """Singular values that are seen, and what stands beside the directions of the others."""
    if root.size == 0:
        return np.zeros(0), right
    u, values, _ = np.linalg.svd(root)
    seen = values > _RANK * max(float(values.max(initial=0.0)), 1e-300)
    return values[seen], u[:, ~seen].T @ right


def _possible_variances(
    triangle: Array, p: int, m: int, random: Sequence[int], count: float
) -> list[tuple[float, float]]:
    """Variances of the random nuisances with their probabilities, the improbable ones left out.

    Before the readings there is none with probability one half, else any that they would show, as
    probable in each octave.
    """
    shown = float((triangle[:, list(random)] ** 2).sum()) / len(random)
    tried = np.concatenate([[0.0], _SIZES / max(shown, 1e-300)])
    evidence = _evidence(triangle, p, m, random, count)
    log = np.array([evidence(float(variance)) for variance in tried])
    log[1:] -= math.log(_SIZES.size)
    weights = np.exp(log - log.max())
    weights[weights < _IMPROBABLE] = 0.0
    weights /= weights.sum()
    return [(float(v), float(w)) for v, w in zip(tried, weights, strict=True) if w > 0.0]


def _evidence(
    triangle: Array, p: int, m: int, random: Sequence[int], count: float
) -> Callable[[float], float]:
    """The restricted likelihood of a variance of the random nuisances, up to a constant.

    With their columns last, what a variance changes is the small triangle R of these alone::

        -2 log L = f log(S/f) + log det(R'R + I/v) + k log v
    """
    last = list(random)
    first = np.delete(np.arange(p + m), last)
    turned: Array = np.asarray(np.linalg.qr(triangle[:, [*first, *last, p + m]], mode="r"))
    at = first.size
    seen, lost = _split(turned[:at, :at], turned[:at, at:])
    small = np.concatenate([lost, turned[at:, at:]])
    freedom = max(count - seen.size, 1.0)

    def evidence(variance: float) -> float:
        variance = max(variance, _NO_VARIANCE)
        prior = np.eye(len(last), len(last) + 1) / math.sqrt(variance)
        r: Array = np.asarray(np.linalg.qr(np.concatenate([small, prior]), mode="r"))
        squares = float(np.sum(r[len(last) :, -1] ** 2))
        diagonal = np.abs(np.diagonal(r)[: len(last)])
        twice = freedom * math.log(max(squares, 1e-300) / freedom)
        twice += 2.0 * float(np.log(diagonal).sum()) + len(last) * math.log(variance)
        return -0.5 * twice

    return evidence


def dense_fixed_point(fit_at: Callable[[Array, bool], DenseFit], size: int) -> DenseFit:
    """The fit at the places that its own patterns correct, from no correction on.

    ``fit_at`` is told whether the places are those of a pattern: until then what is left is not
    noise, and tells of no random nuisance.
    """
    coefficients = np.zeros(size)
    for number in range(_ROUNDS):
        fit = fit_at(coefficients, number >= _AT_FIRST)
        # What is hardly seen is noise of any size: it moves no place.
        found = np.where(fit.projected.told, fit.patterns, 0.0)
        std = np.sqrt(np.maximum(np.diagonal(fit.covariance), 1e-300))
        still = np.abs((found - coefficients) / std).max(initial=0.0) < _STILL
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

    By the greater of two: what neighbours say, and means over blocks, less what slow patterns take
    up of them, for what is left that outlasts any of its neighbours.
    """
    if not fit.correlated:
        return 1.0
    left = fit.residuals
    size = max(1, left.size // _BLOCKS)
    means = left[: _BLOCKS * size].reshape(_BLOCKS, size).mean(axis=1)
    free = max(_BLOCKS - fit.patterns.size, _BLOCKS // 2)
    blocks = size * float(means @ means) / free / fit.projected.variance
    return max(1.0, blocks, float(fit.correlation.spectrum(np.zeros(1))[0]))
