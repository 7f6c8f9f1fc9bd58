"""Rows of a dense fit as series in time: what it makes of noise that correlates along them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..support.arrays import Array
from .correlation import Correlation, lag_pairs, lag_sums
from .densetriangle import DenseRows


class DenseSeries:
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
        pairs = lag_pairs([len(rows) for rows in self.rows], most)
        middle = self._middle(correlation)
        for rows in self.rows:
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
