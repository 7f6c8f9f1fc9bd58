"""Blocks of regressors that are scored together: all lines of one cause, say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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


def block_gram(columns: Array, width: int) -> Array:
    """Products of the columns within each block, shape (blocks, width, width)."""
    cut = columns.reshape(len(columns), -1, width)
    gram = np.empty((cut.shape[1], width, width))
    for i in range(width):
        for j in range(i, width):
            gram[:, i, j] = gram[:, j, i] = np.einsum("nb,nb->b", cut[:, :, i], cut[:, :, j])
    return gram
