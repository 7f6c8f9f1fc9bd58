"""Blocks of regressors that are scored together: all lines of one cause, for example."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array
from .whitening import Whitener


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
        self.groups: list[tuple[NDArray[np.int64], BlockProducts]] = []
        widths = np.array([block.shape[1] for block in blocks])
        for width in sorted({*widths.tolist()}):
            where = np.flatnonzero(widths == width)
            columns = np.ascontiguousarray(np.hstack([blocks[int(k)] for k in where]))
            self.groups.append((where, BlockProducts(columns, width)))


class BlockProducts:
    """Products of the columns within blocks of one width, under any noise.

    With X a block and M the map that makes the noise white, ``Xᵀ Mᵀ M X``. Correlated
    noise needs the products of neighbouring readings as well: these are kept, so that
    another correlation costs no pass over the readings.

    Parameters
    ----------
    columns : ndarray, shape (n, blocks * width)
        Of either precision, rows one after the other.
    width : int
    """

    def __init__(self, columns: NDArray[Any], width: int) -> None:
        self.columns = columns
        self.width = width
        self._weights: Array | None = None
        self._lagged: tuple[Array, Array, Array] | None = None

    def under(self, whiten: Whitener) -> Array:
        """Products within each block, shape (blocks, width, width)."""
        if self._lagged is None or self._weights is not whiten.weights:
            self._weights = whiten.weights
            self._lagged = _core.block_products(
                self.columns, self.width, whiten.bounds, whiten.root_weights
            )
        same, inner, cross = self._lagged
        if whiten.is_identity:
            return same
        found = same + whiten.rho**2 * inner - whiten.rho * cross
        if whiten.effects:
            w, c = whiten.taken()
            w = w.astype(self.columns.dtype, copy=False)
            for (start, stop), share in zip(whiten.bounds, c, strict=True):
                part = np.sqrt(share)[:, None] * (w[start:stop].T @ self.columns[start:stop])
                whole = [(0, len(part))]
                found -= _core.block_products(part, self.width, whole)[0]
        return found
