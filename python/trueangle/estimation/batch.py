"""Blocks of regressors that are scored together: all lines of one cause, say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .whitening import Whitener

__all__ = ["Blocks", "Products"]

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
        #: The places of the blocks of every width, and their columns.
        self.groups: list[tuple[NDArray[np.int64], Products]] = []
        widths = np.array([block.shape[1] for block in blocks])
        for width in np.unique(widths):
            where = np.flatnonzero(widths == width)
            columns = np.hstack([blocks[int(k)] for k in where])
            self.groups.append((where, Products(columns, int(width))))


class Products:
    """Products of the columns within blocks of one width, under any noise.

    With X a block and M the map that makes the noise white, ``Xᵀ Mᵀ M X``. Correlated
    noise asks for the products of neighbouring readings as well: these are kept, so that
    another correlation costs no pass over the readings.

    Parameters
    ----------
    columns : ndarray, shape (n, blocks * width)
    width : int
    """

    def __init__(self, columns: NDArray[Any], width: int) -> None:
        self.columns = columns
        self.width = width
        self._plain: Array | None = None
        self._weights: Array | None = None
        self._lagged: tuple[Array, Array, Array] | None = None

    def under(self, whiten: Whitener) -> Array:
        """Products within each block, shape (blocks, width, width)."""
        if whiten.is_identity:
            if self._plain is None:
                self._plain = _gram(self.columns, self.width)
            return self._plain
        if self._lagged is None or self._weights is not whiten.weights:
            self._weights, self._lagged = whiten.weights, self._neighbours(whiten)
        same, inner, cross = self._lagged
        found = same + whiten.rho**2 * inner - whiten.rho * cross
        if whiten.effects:
            w, c = whiten.taken()
            w = w.astype(self.columns.dtype, copy=False)
            for (start, stop), share in zip(whiten.bounds, c, strict=True):
                part = w[start:stop].T @ self.columns[start:stop]
                found -= _gram(np.sqrt(share)[:, None] * part, self.width)
        return found

    def _neighbours(self, whiten: Whitener) -> tuple[Array, Array, Array]:
        """Products at one reading, at those that end no run, and with the reading before."""
        columns, width = self.columns, self.width
        if whiten.root_weights is not None:
            columns = columns * whiten.root_weights.astype(columns.dtype)[:, None]
        same = _gram(columns, width)
        first, stop = np.array(whiten.bounds).T
        inner = same - _gram(columns[first], width) - _gram(columns[stop - 1], width)
        cross = _gram(columns[:-1], width, columns[1:])
        # Runs are no neighbours.
        cross -= _gram(columns[first[1:] - 1], width, columns[first[1:]])
        return same, inner, cross + np.swapaxes(cross, 1, 2)


def _gram(columns: NDArray[Any], width: int, others: NDArray[Any] | None = None) -> Array:
    """Products of columns, or of them with others, within each block."""
    cut = columns.reshape(len(columns), columns.shape[1] // width, width)
    gram = np.empty((cut.shape[1], width, width))
    beside = cut if others is None else others.reshape(cut.shape)
    for i in range(width):
        for j in range(0 if others is not None else i, width):
            gram[:, i, j] = np.einsum("nb,nb->b", cut[:, :, i], beside[:, :, j])
            if others is None:
                gram[:, j, i] = gram[:, i, j]
    return gram
