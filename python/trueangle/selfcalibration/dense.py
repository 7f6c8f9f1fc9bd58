"""Patterns beside plain nuisances: zeros of runs, ratios, couplings that change with clamping."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..support.arrays import Array
from .projected import NOT_SEEN, Projected, Unknown

#: Variances of random terms that are tried, relative to the noise (powers of ten).
_POWERS: Final[tuple[float, ...]] = (-math.inf, *np.linspace(-4.0, 10.0, 57).tolist())

#: No variance at all: a prior so tight that the term is nothing.
_NO_VARIANCE: Final = 1e-24

#: Singular values of patterns below this share of the largest are not seen.
_RANK: Final = 1e-9

#: Correlation of neighbouring residuals from which standard errors are taken from blocks.
_CORRELATED: Final = 0.1
_BLOCKS: Final = 40

#: Fits of which each is made at the places that the one before corrects, at most, and the standard
#: errors within which coefficients no longer move.
_ROUNDS: Final = 8
_STILL: Final = 0.02


@dataclass(frozen=True)
class DenseRows:
    """A part of the readings: patterns (n, m), nuisances (n, p), target (n)."""

    patterns: Array
    nuisances: Array
    target: Array
    alone: Array | None = None
    """Sum of squares of each pattern by itself, where the rows hold differences."""

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
    """Of the patterns; from blocks where neighbouring residuals agree."""
    correlated: bool
    triangle: Array
    """Of nuisances, patterns and target: all that fits of fewer columns need."""

    @property
    def notes(self) -> list[str]:
        """What its standard errors are of, where they are not those of independent readings."""
        told = "neighbouring residuals agree: standard errors are taken from blocks"
        return [told] if self.correlated else []


def fit_dense(
    parts: Sequence[DenseRows],
    columns: Sequence[Unknown],
    random: Sequence[int] = (),
    freedom_lost: float = 0.0,
    floor: float = NOT_SEEN,
) -> DenseFit:
    """Least squares by orthogonal triangles, the nuisances eliminated first.

    ``random`` nuisances are drawn anew in every run, with one variance, found by evidence;
    ``freedom_lost`` counts rows that say nothing of their own (differences to a mean); combinations
    of patterns of which less than ``floor`` is left count as not seen.
    """
    p, m = parts[0].nuisances.shape[1], len(columns)
    triangle = _triangle(parts)
    count = sum(part.target.size for part in parts) - freedom_lost
    alone = np.sum([part.squares for part in parts], axis=0)
    variance = 0.0
    if len(random):
        variance = _best_variance(triangle, p, m, random, count)
    solved = _solve(triangle, p, m, random, variance, count)
    projected = Projected(
        tuple(columns),
        solved.root.T @ solved.root,
        solved.root.T @ solved.right,
        np.where(alone > 1e-12 * max(float(alone.max(initial=0.0)), 1e-300), alone, 0.0),
        solved.noise,
        solved.freedom,
        floor,
    )
    patterns = projected.solution
    inverse: Array = np.asarray(np.linalg.pinv(solved.corner, 1e-12), dtype=np.float64)
    nuisances: Array = np.asarray(inverse @ (solved.corner_right - solved.beside @ patterns))
    # Standard errors of the nuisances with the patterns fitted beside.
    through = inverse @ solved.beside
    spread = inverse @ inverse.T + through @ projected.inverse @ through.T
    residuals = np.concatenate(
        [q.target - q.patterns @ patterns - q.nuisances @ nuisances for q in parts]
    )
    covariance, correlated = projected.covariance, False
    size = float(residuals @ residuals)
    if residuals.size > 200 and size > 0.0:
        lag = float(residuals[:-1] @ residuals[1:]) / size
        correlated = lag > _CORRELATED
    if correlated:
        covariance = _from_blocks(parts, projected, inverse, solved.beside, residuals)
    return DenseFit(
        projected,
        patterns,
        nuisances,
        np.sqrt(np.maximum(solved.noise * np.diagonal(spread), 0.0)),
        variance,
        residuals,
        covariance,
        correlated,
        triangle,
    )


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
    corner: Array  # of the nuisances
    beside: Array  # nuisances against patterns
    corner_right: Array
    root: Array  # of the patterns
    right: Array
    noise: float
    freedom: float


def _solve(
    triangle: Array, p: int, m: int, random: Sequence[int], variance: float, count: float
) -> _Solved:
    prior = np.zeros((len(random), triangle.shape[1]))
    prior[np.arange(len(random)), list(random)] = 1.0 / math.sqrt(max(variance, _NO_VARIANCE))
    r: Array = np.asarray(np.linalg.qr(np.concatenate([triangle, prior]), mode="r"))
    root, right, left = r[p : p + m, p : p + m], r[p : p + m, -1:], r[p + m :, -1]
    # Patterns that nothing shows leave the sum of squares as it is: pseudo-inverse.
    seen, lost = _split(root, right)
    freedom = max(count - (p - len(random) + seen.size), 1.0)
    squares = float(left @ left) + float(np.sum(lost**2))
    return _Solved(
        r[:p, :p], r[:p, p : p + m], r[:p, -1], root, right[:, 0], squares / freedom, freedom
    )


def _split(root: Array, right: Array) -> tuple[Array, Array]:
    """Singular values that are seen, and what stands beside the directions of the others."""
    if root.size == 0:
        return np.zeros(0), right
    u, values, _ = np.linalg.svd(root)
    seen = values > _RANK * max(float(values.max(initial=0.0)), 1e-300)
    return values[seen], u[:, ~seen].T @ right


def _best_variance(triangle: Array, p: int, m: int, random: Sequence[int], count: float) -> float:
    """The variance of the random nuisances by their evidence, to a quarter of a decade."""
    tried = [math.pow(10.0, power) for power in _POWERS]
    return max(tried, key=_evidence(triangle, p, m, random, count))


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


def dense_fixed_point(fit_at: Callable[[Array], DenseFit], size: int) -> DenseFit:
    """The fit at the places that its own patterns correct, from no correction on."""
    coefficients = np.zeros(size)
    for _ in range(_ROUNDS):
        fit = fit_at(coefficients)
        # What is hardly seen is noise of any size: it moves no place.
        found = np.where(fit.projected.seen, fit.patterns, 0.0)
        std = np.sqrt(np.maximum(np.diagonal(fit.covariance), 1e-300))
        still = np.abs((found - coefficients) / std).max(initial=0.0) < _STILL
        coefficients = found
        if still:
            break
    return fit


def low_frequency_inflation(fit: DenseFit) -> float:
    """Variance of slow patterns relative to independent residuals; 1 at least.

    By the greater of two: means over blocks, less what slow patterns take up of them; and
    neighbours, ``(1 + r) / (1 - r)``, for noise that outlasts a block's share of that.
    """
    if not fit.correlated:
        return 1.0
    left = fit.residuals
    size = max(1, left.size // _BLOCKS)
    means = left[: _BLOCKS * size].reshape(_BLOCKS, size).mean(axis=1)
    free = max(_BLOCKS - fit.patterns.size, _BLOCKS // 2)
    r = float(left[:-1] @ left[1:]) / float(left @ left)
    blocks = size * float(means @ means) / free / fit.projected.variance
    return max(1.0, blocks, (1.0 + r) / (1.0 - r))


def _from_blocks(
    parts: Sequence[DenseRows],
    projected: Projected,
    inverse: Array,
    beside: Array,
    residuals: Array,
) -> Array:
    """Covariance of the patterns from scores summed over blocks of neighbours."""
    through = inverse @ beside  # what the nuisances take of the patterns
    scores = []
    for chunk, values in _blocks(parts, residuals):
        x = chunk.patterns - chunk.nuisances @ through
        scores.append(x.T @ values)
    stacked = np.array(scores)
    middle = stacked.T @ stacked * (len(scores) / (len(scores) - 1.0))
    return np.asarray(projected.inverse @ middle @ projected.inverse)


def _blocks(parts: Sequence[DenseRows], residuals: Array) -> Iterator[tuple[DenseRows, Array]]:
    total = residuals.size
    size = max(1, total // _BLOCKS)
    at = 0
    for part in parts:
        n = part.target.size
        for a in range(0, n, size):
            b = min(a + size, n)
            yield (
                DenseRows(part.patterns[a:b], part.nuisances[a:b], part.target[a:b]),
                residuals[at + a : at + b],
            )
        at += n
