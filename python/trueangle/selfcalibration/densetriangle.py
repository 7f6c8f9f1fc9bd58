"""Rows of a dense fit as one triangle: solved with random nuisances of any variance, and which."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..estimation.factor import orthonormal_basis
from ..support.arrays import Array
from .correlation import Correlation

#: Variances of random terms that are tried, over that of their error in one run: from what the
#: readings do not show on, two a decade.
_SIZES: Final = np.logspace(-1.0, 12.0, 27)


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
        """Sum of squares of each pattern by itself."""
        if self.alone is not None:
            return self.alone
        return np.asarray(np.einsum("ij,ij->j", self.patterns, self.patterns))

    def whitened(self, correlation: Correlation) -> DenseRows:
        """The part of each row that earlier rows of its series do not predict."""
        whole = np.column_stack([self.patterns, self.nuisances, self.target])
        rows = np.concatenate([correlation.whitened(one) for one in np.split(whole, self.series)])
        m = self.patterns.shape[1]
        return DenseRows(rows[:, :m], rows[:, m:-1], rows[:, -1])


def triangle_of(parts: Iterable[DenseRows]) -> Array:
    """The triangle of ``[nuisances | patterns | target]``, part by part."""
    triangle: Array | None = None
    for part in parts:
        block = np.concatenate([part.nuisances, part.patterns, part.target[:, None]], axis=1)
        if triangle is not None:
            block = np.concatenate([triangle, block])
        triangle = _triangle(block)
    assert triangle is not None
    return triangle


def _triangle(rows: Array) -> Array:
    return np.asarray(np.linalg.qr(rows, mode="r"))


@dataclass(frozen=True)
class SolvedTriangle:
    """Nuisances eliminated: what remains for the patterns, and the noise."""

    inverse: Array  # of the nuisances' triangle
    beside: Array  # nuisances against patterns
    corner_right: Array
    root: Array  # of the patterns
    right: Array
    beyond: float  # squares that no pattern could explain

    @property
    def information(self) -> Array:
        """Of the patterns, estimated jointly with the nuisances."""
        return np.asarray(self.root.T @ self.root)

    def squares(self, seen: Array) -> float:
        """Sum of squares left by a fit of these combinations of the patterns, columns of ``seen``.

        Others may come from the noise of the angles alone, and would be fitted to the residual.
        """
        basis = orthonormal_basis(self.root @ seen)
        lost = self.right - basis @ (basis.T @ self.right)
        return self.beyond + float(lost @ lost)


def solved_triangle(
    triangle: Array, p: int, m: int, random: Sequence[int], variance: float
) -> SolvedTriangle:
    """The triangle of ``p`` nuisances and ``m`` patterns, with random ones of a variance."""
    # In units of their own deviation random nuisances have the prior 1, of any variance, and
    # of none the columns vanish: nothing is rounded at the size of a prior that is tight.
    scale = np.ones(p)
    scale[list(random)] = math.sqrt(variance)
    scaled = triangle.copy()
    scaled[:, :p] *= scale
    prior = np.zeros((len(random), triangle.shape[1]))
    prior[np.arange(len(random)), list(random)] = 1.0
    r = _triangle(np.concatenate([scaled, prior]))
    left = r[p + m :, -1]
    inverse: Array = np.asarray(np.linalg.pinv(r[:p, :p], 1e-12), dtype=np.float64)
    return SolvedTriangle(
        scale[:, None] * inverse,
        r[:p, p : p + m],
        r[:p, -1],
        r[p : p + m, p : p + m],
        r[p : p + m, -1],
        float(left @ left),
    )


def _split(root: Array, right: Array) -> tuple[Array, Array]:
    """The singular values that are not zero, and ``right`` along the directions of the others."""
    if root.size == 0:
        return np.zeros(0), right
    u, values, _ = np.linalg.svd(root)
    # Singular values of patterns below this share of the largest count as zero.
    seen = values > 1e-9 * max(float(values.max(initial=0.0)), 1e-300)
    return values[seen], u[:, ~seen].T @ right


def possible_variances(
    triangle: Array, p: int, seen: Array, random: Sequence[int], count: float
) -> list[tuple[float, float]]:
    """Variances of the random nuisances with their probabilities, the improbable ones omitted.

    Only identifiable combinations of the patterns take part, the columns of ``seen``.

    The prior: zero with probability one half, else any variance that the readings would show,
    equally probable in each octave.
    """
    shown = float((triangle[:, list(random)] ** 2).sum()) / len(random)
    tried = np.concatenate([[0.0], _SIZES / max(shown, 1e-300)])
    combined = np.hstack([triangle[:, :p], triangle[:, p:-1] @ seen, triangle[:, -1:]])
    evidence = _evidence(combined, p, seen.shape[1], random, count)
    log = np.array([evidence(float(variance)) for variance in tried])
    log[1:] -= math.log(_SIZES.size)
    weights = np.exp(log - log.max())
    # Variances less probable than this share of the most probable one are omitted.
    weights[weights < 1e-2] = 0.0
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
    turned = _triangle(triangle[:, [*first, *last, p + m]])
    at = first.size
    seen, lost = _split(turned[:at, :at], turned[:at, at:])
    small = np.concatenate([lost, turned[at:, at:]])
    freedom = max(count - seen.size, 1.0)

    def evidence(variance: float) -> float:
        # No variance at all: a prior so tight that the term is nothing.
        variance = max(variance, 1e-24)
        prior = np.eye(len(last), len(last) + 1) / math.sqrt(variance)
        r = _triangle(np.concatenate([small, prior]))
        squares = float(np.sum(r[len(last) :, -1] ** 2))
        diagonal = np.abs(np.diagonal(r)[: len(last)])
        twice = freedom * math.log(max(squares, 1e-300) / freedom)
        twice += 2.0 * float(np.log(diagonal).sum()) + len(last) * math.log(variance)
        return -0.5 * twice

    return evidence
