"""Blocks of regressors that are scored together: all lines of one cause, say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .whitening import Whitener

__all__ = ["Blocks", "block_gram"]

Array = NDArray[np.float64]


class Blocks:
    """Blocks of regressors side by side, grouped by their number of columns.

    Parameters
    ----------
    blocks : sequence of ndarray, shape (n, p)
        p may differ between blocks.
    """

    def __init__(self, blocks: Sequence[Array]) -> None:
        self.count = len(blocks)
        #: For every width: the places of its blocks, their columns, their products.
        self.groups: list[tuple[NDArray[np.int64], int, Array, Array]] = []
        widths = np.array([block.shape[1] for block in blocks])
        for width in np.unique(widths):
            where = np.flatnonzero(widths == width)
            columns = np.hstack([blocks[int(k)] for k in where])
            self.groups.append((where, int(width), columns, block_gram(columns, int(width))))
        self._weights: Array | None = None
        self._lagged: list[tuple[Array, Array, Array]] = []

    def grams(self, whiten: Whitener) -> list[Array]:
        """Products of the columns within each block under a noise, group by group.

        Correlated noise asks for the products of neighbours as well, which are kept.
        """
        if whiten.is_identity:
            return [gram for *_, gram in self.groups]
        if whiten.weights is not self._weights or not self._lagged:
            self._weights = whiten.weights
            self._lagged = [_lagged(columns, width, whiten) for _, width, columns, _ in self.groups]
        rho = whiten.rho
        found = [same + rho**2 * inner - rho * cross for same, inner, cross in self._lagged]
        if whiten.effects:
            w, c = whiten.taken()
            for (_, width, columns, _), gram in zip(self.groups, found, strict=True):
                for (start, stop), share in zip(whiten.bounds, c, strict=True):
                    part = np.sqrt(share)[:, None] * (w[start:stop].T @ columns[start:stop])
                    gram -= block_gram(part, width)
        return found


def _lagged(columns: Array, width: int, whiten: Whitener) -> tuple[Array, Array, Array]:
    """Products at one reading, of those that are no ends of runs, and with the one before."""
    if whiten.root_weights is not None:
        columns = columns * whiten.root_weights[:, None]
    same = block_gram(columns, width)
    inner, cross = same.copy(), np.zeros_like(same)
    for start, stop in whiten.bounds:
        inner -= block_gram(columns[[start, stop - 1]], width)
        cross += block_gram(columns[start : stop - 1], width, columns[start + 1 : stop])
    return same, inner, cross + np.swapaxes(cross, 1, 2)


def block_gram(columns: Array, width: int, others: Array | None = None) -> Array:
    """Products of the columns within each block, shape (blocks, width, width).

    With ``others``, those of the columns with others of the same shape.
    """
    cut = columns.reshape(len(columns), -1, width)
    gram = np.empty((cut.shape[1], width, width))
    if others is not None:
        beside = others.reshape(len(columns), -1, width)
        for i in range(width):
            for j in range(width):
                gram[:, i, j] = np.einsum("nb,nb->b", cut[:, :, i], beside[:, :, j])
        return gram
    for i in range(width):
        for j in range(i, width):
            gram[:, i, j] = gram[:, j, i] = np.einsum("nb,nb->b", cut[:, :, i], cut[:, :, j])
    return gram
