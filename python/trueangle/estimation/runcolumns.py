"""Columns of an error that every run draws anew, with their products run by run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .whitening import Whitener

__all__ = ["RunEffectColumns"]

Array = NDArray[np.float64]


class RunEffectColumns:
    """Shapes of a run effect, and their products in every run under any noise.

    With X the columns in a run and M the map that makes the noise white, ``Xᵀ Mᵀ M X``
    follows from sums over equal and neighbouring readings, which are made once.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
    bounds : list of (int, int)
        The runs.
    """

    def __init__(self, columns: Array, bounds: list[tuple[int, int]]) -> None:
        self.columns = columns
        self.bounds = bounds
        self._weights: Array | None = None
        self._same: Array | None = None
        self._sums: tuple[Array, Array] | None = None

    def grams(self, whiten: Whitener) -> Array:
        """Products of the columns in every run, shape (runs, k, k)."""
        if self._same is None or self._weights is not whiten.weights:
            x, self._weights, self._sums = self._weighted(whiten), whiten.weights, None
            self._same = np.array([x[a:b].T @ x[a:b] for a, b in self.bounds])
        found = self._same
        if whiten.rho != 0.0:
            if self._sums is None:
                self._sums = self._neighbours(self._weighted(whiten), found)
            inner, cross = self._sums
            found = found + whiten.rho**2 * inner - whiten.rho * cross
        if whiten.effects:
            w, c = whiten.taken()
            parts = [self.columns[a:b].T @ w[a:b] for a, b in self.bounds]
            share = np.array(parts)
            found = found - (share * c[:, None, :]) @ np.swapaxes(share, 1, 2)
        return np.asarray(found)

    def moments(self, seen: Array) -> Array:
        """Products with columns that were mapped twice, in every run: shape (runs, k, m)."""
        return np.array([self.columns[a:b].T @ seen[a:b] for a, b in self.bounds])

    def _weighted(self, whiten: Whitener) -> Array:
        roots = whiten.root_weights
        return self.columns if roots is None else self.columns * roots[:, None]

    def _neighbours(self, x: Array, same: Array) -> tuple[Array, Array]:
        """Products at readings that end no run, and with the reading before."""
        ends = np.array([[a, b - 1] for a, b in self.bounds])
        first, last = x[ends[:, 0]], x[ends[:, 1]]
        inner = same - first[:, :, None] * first[:, None, :] - last[:, :, None] * last[:, None, :]
        cross = np.array([x[a : b - 1].T @ x[a + 1 : b] for a, b in self.bounds])
        return inner, cross + np.swapaxes(cross, 1, 2)
