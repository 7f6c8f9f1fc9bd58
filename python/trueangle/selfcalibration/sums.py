"""Sums over readings: normal equations of a spline in time beside common columns."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .splines import BAND, Knots, spline_basis

#: Readings whose columns are made at once: some MB, so that they stay in cache.
_CHUNK = 4096


class MotionSums(NamedTuple):
    """Normal equations of splines (banded) and common columns, for one target."""

    knots: Knots
    bands: Array
    """``S^T S``, shape (size, 4)."""
    cross: Array
    """``S^T X``, shape (size, m)."""
    spline_right: Array
    """``S^T e``."""
    common: Array
    """``X^T X``."""
    common_right: Array
    """``X^T e``."""
    squares: float
    """``e^T e``."""
    weighty: float
    """Readings of weight."""

    @property
    def bare(self) -> MotionSums:
        """The splines alone, as if the patterns were settled."""
        return self._replace(
            cross=self.cross[:, :0], common=self.common[:0, :0], common_right=self.common_right[:0]
        )


def ordered_motion_sums(
    knots: Knots,
    index: NDArray[np.int64],
    place: Array,
    target: Array,
    weight: Array,
    columns: Callable[[slice, Array], None],
    width: int,
    valid: NDArray[np.bool_] | None = None,
) -> MotionSums:
    """Sums over readings in order of time.

    ``index`` and ``place`` are those of `Knots.place`, the index not decreasing; ``target`` is what
    is left of each reading, ``weight`` the factor of the splines in its row, ``1 + error'``.
    ``columns`` writes the ``width`` common columns of a slice of readings into an array; only
    ``valid`` readings count.
    """
    size, n = knots.size, target.size
    bands, cross = np.zeros((size, BAND)), np.zeros((size, width + 1))
    common = np.zeros((width + 1, width + 1))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(index)) + 1, [n]])
    chunk_edges = np.unique(
        np.concatenate([edges[np.searchsorted(edges, np.arange(0, n, _CHUNK))], [n]])
    )
    upper = [(p, q) for p in range(4) for q in range(p, 4)]
    for a, b in itertools.pairwise(chunk_edges):
        rows = np.empty((width + 5, b - a))
        columns(slice(a, b), rows[:width])
        rows[width] = target[a:b]
        rows[width + 1 :] = spline_basis(place[a:b]) * weight[a:b]
        if valid is not None:
            rows *= valid[a:b]
        x = rows[: width + 1]
        common += x @ x.T
        splines = rows[width + 1 :]
        inner = edges[np.searchsorted(edges, a) : np.searchsorted(edges, b) + 1] - a
        for i, j in itertools.pairwise(inner):
            first = int(index[a + i])
            block = splines[:, i:j] @ rows[:, i:j].T
            cross[first : first + 4] += block[:, : width + 1]
            square = block[:, width + 1 :]
            for p, q in upper:
                bands[first + p, q - p] += square[p, q]
    return MotionSums(
        knots,
        bands,
        cross[:, :width],
        cross[:, width],
        common[:width, :width],
        common[:width, width],
        float(common[width, width]),
        float(n if valid is None else valid.sum()),
    )
