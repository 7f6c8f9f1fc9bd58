"""Columns under some noise, made orthonormal: what blocks have in common is not made anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import trueangle._core as _core

from ..support.arrays import Array
from .whitening import RunEffect, Whitener

#: Singular values below this share of the largest do not count.
DISTINCT = 1e-7

#: Condition up to which the triangle of the Gram matrix is as good as one of the columns: its
#: square costs half of the digits. Up to the smaller one a single pass leaves 1e-13.
WELL, VERY_WELL = 1e4, 10.0

#: Columns in all for each one that growing by it is quicker than to begin anew.
GROWN = 4


@dataclass(frozen=True, eq=False)
class Factor:
    """Blocks of columns X under a noise: ``Q = M X B`` with orthonormal columns.

    Attributes
    ----------
    whiten : Whitener
        M.
    blocks : tuple of ndarray
        X, in parts.
    q : ndarray, shape (n, r)
    back : ndarray, shape (p, r)
        B: coefficients of X are ``back @ (q.T @ M y)``, the smallest ones where columns
        are alike.
    scaled : ndarray or None, shape (p, p)
        B for columns of length 1, an upper triangle; None where columns are alike.
    lengths : ndarray, shape (p,)
    """

    whiten: Whitener
    blocks: tuple[Array, ...]
    q: Array
    back: Array
    scaled: Array | None
    lengths: Array

    @classmethod
    def of(
        cls,
        blocks: Sequence[Array],
        bounds: list[tuple[int, int]],
        rho: float,
        effects: Sequence[RunEffect],
        weights: Array | None,
        before: Sequence[Factor] = (),
        whole: Array | None = None,
    ) -> Factor:
        """The factor of some blocks; what those ``before`` have done is taken from them.

        ``whole`` are the blocks side by side, where these are at hand.
        """
        blocks = tuple(blocks)
        like = next((f for f in before if f.whiten.has(rho, effects, weights)), None)
        if like is None:
            return cls._fresh(blocks, Whitener(bounds, rho, list(effects), weights), whole)
        same = in_common(like.blocks, blocks)
        further = sum(block.shape[1] for block in blocks[same:])
        if like.scaled is not None and GROWN * further <= sum(b.shape[1] for b in blocks):
            grown = like._first(same)._grown(blocks)
            if grown is not None:
                return grown
        return cls._fresh(blocks, like.whiten, whole)

    @classmethod
    def _fresh(cls, blocks: tuple[Array, ...], whiten: Whitener, whole: Array | None) -> Factor:
        x = whiten(np.hstack(blocks) if whole is None else whole)
        made = _orthonormal(x)
        if made is not None:
            q, scaled, lengths = made
            return cls(whiten, blocks, q, scaled / lengths[:, None], scaled, lengths)
        lengths = np.sqrt(np.einsum("ij,ij->j", x, x))
        lengths[lengths == 0.0] = 1.0
        u, s, vt = np.linalg.svd(x / lengths, full_matrices=False)
        kept = s > DISTINCT * s[0]
        back = vt[kept].T / s[kept] / lengths[:, None]
        return cls(whiten, blocks, u[:, kept], back, None, lengths)

    def left_of(self, columns: Array) -> Array:
        """Columns under the noise, less what those of the factor take of them."""
        x = self.whiten(columns)
        return np.asarray(x - self.q @ (self.q.T @ x))

    def _first(self, count: int) -> Factor:
        """That of the first blocks alone: no column depends on those after it."""
        if count == len(self.blocks):
            return self
        assert self.scaled is not None
        blocks = self.blocks[:count]
        p = sum(block.shape[1] for block in blocks)
        back, scaled = self.back[:p, :p], self.scaled[:p, :p]
        return Factor(self.whiten, blocks, self.q[:, :p], back, scaled, self.lengths[:p])

    def _grown(self, blocks: tuple[Array, ...]) -> Factor | None:
        """With further blocks; None where they are nearly among those before."""
        assert self.scaled is not None
        if len(blocks) == len(self.blocks):
            return self
        x = self.whiten(np.hstack(blocks[len(self.blocks) :]))
        if not x.shape[1]:
            return Factor(self.whiten, blocks, self.q, self.back, self.scaled, self.lengths)
        lengths = np.sqrt(np.einsum("ij,ij->j", x, x))
        if not lengths.all():
            return None
        x = x / lengths
        known = self.q.T @ x
        x -= self.q @ known
        again = self.q.T @ x
        x -= self.q @ again
        made = _orthonormal(x)
        if made is None or made[2].min() < 1.0 / WELL:
            return None
        q, scaled, rest = made
        own = scaled / rest[:, None]
        p, k = self.scaled.shape[0], own.shape[0]
        whole = np.zeros((p + k, p + k))
        whole[:p, :p] = self.scaled
        whole[:p, p:] = -self.scaled @ (known + again) @ own
        whole[p:, p:] = own
        if np.linalg.norm(whole) > WELL:
            return None
        lengths = np.concatenate([self.lengths, lengths])
        back = whole / lengths[:, None]
        return Factor(self.whiten, blocks, np.hstack([self.q, q]), back, whole, lengths)


def in_common(one: Sequence[Array], other: Sequence[Array]) -> int:
    """How many blocks, the same arrays, two sequences begin with."""
    same = 0
    while same < min(len(one), len(other)) and one[same] is other[same]:
        same += 1
    return same


def orthonormal_basis(x: Array) -> Array:
    """Columns of length 1 at right angles that span the same."""
    made = _orthonormal(x)
    if made is not None:
        return made[0]
    u, s, _ = np.linalg.svd(x / np.linalg.norm(x, axis=0).clip(1e-300), full_matrices=False)
    return np.asarray(u[:, s > DISTINCT * s[0]])


def _orthonormal(x: Array) -> tuple[Array, Array, Array] | None:
    """Q, B and the lengths of the columns, ``Q = (X / lengths) B``; None where ill-conditioned."""
    gram = x.T @ x
    lengths = np.sqrt(np.diag(gram))
    if not lengths.size or not lengths.all():
        return None
    try:
        lower = np.linalg.cholesky(gram / np.outer(lengths, lengths))
    except np.linalg.LinAlgError:
        return None
    scaled = np.linalg.inv(lower).T
    condition = float(np.linalg.norm(scaled))
    if not condition < WELL:
        return None
    # Rows of the transpose, so that columns stand one after the other.
    rows = (scaled / lengths[:, None]).T @ x.T
    if condition > VERY_WELL:
        again = np.linalg.inv(np.linalg.cholesky(rows @ rows.T))
        rows, scaled = again @ rows, scaled @ again.T
    return rows.T, scaled, lengths


class BandedFactor:
    """Cholesky factor ``L Lᵀ`` of a matrix of four diagonals: O(n) work and memory.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not positive definite to working precision.
    """

    def __init__(self, bands: Array) -> None:
        factor = _core.Banded.factor(bands)
        if factor is None:
            raise np.linalg.LinAlgError("not positive definite to working precision")
        self._factor = factor
        self.log_determinant = factor.log_determinant

    def solve(self, right: Array) -> Array:
        """``M^-1 right`` for a vector or columns."""
        solved = np.array(right, dtype=np.float64, order="C")
        self._factor.solve(solved.reshape(solved.shape[0], -1))
        return solved
