"""Symmetric positive definite banded systems, solved block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .splines import BAND

__all__ = ["BandedFactor"]

Array = NDArray[np.float64]

#: Rows of a block: the work per row grows with it, the number of calls falls.
_BLOCK = 48


class BandedFactor:
    r"""Cholesky factor of a banded matrix, as a chain of dense blocks.

    With diagonal blocks :math:`D_k` and couplings :math:`E_k` the Schur complements
    :math:`\tilde D_k = D_k - E_{k-1}^T \tilde D_{k-1}^{-1} E_{k-1}` are factored in turn:
    O(n) work and memory, numpy alone.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not positive definite to working precision.
    """

    def __init__(self, bands: Array) -> None:
        n = bands.shape[0]
        self.size = n
        count = -(-n // _BLOCK)
        padded = np.zeros((count * _BLOCK, BAND))
        padded[:n] = bands
        padded[n:, 0] = 1.0  # rows that do not exist: the unit matrix
        rows = padded.reshape(count, _BLOCK, BAND)
        diagonal = np.zeros((count, _BLOCK, _BLOCK))
        coupling = np.zeros((count, _BLOCK, _BLOCK))
        for lag in range(BAND):
            i = np.arange(_BLOCK - lag)
            diagonal[:, i, i + lag] = rows[:, : _BLOCK - lag, lag]
            diagonal[:, i + lag, i] = rows[:, : _BLOCK - lag, lag]
            i = np.arange(_BLOCK - lag, _BLOCK)
            coupling[:, i, i + lag - _BLOCK] = rows[:, _BLOCK - lag :, lag]
        self.inverse = np.empty_like(diagonal)  # of the lower factors
        self.link = np.zeros_like(coupling)  # L_k^-1 E_k
        self.log_determinant = 0.0
        unit = np.eye(_BLOCK)
        for k in range(count):
            block = diagonal[k]
            if k:
                block = block - self.link[k - 1].T @ self.link[k - 1]
            lower = np.linalg.cholesky(block)
            self.log_determinant += 2.0 * float(np.log(np.diagonal(lower)).sum())
            self.inverse[k] = np.linalg.solve(lower, unit)
            self.link[k] = self.inverse[k] @ coupling[k]

    def solve(self, right: Array) -> Array:
        """``M^-1 right`` for a vector or columns."""
        count = len(self.inverse)
        shape = right.shape
        flat = right.reshape(self.size, -1)
        padded = np.zeros((count * _BLOCK, flat.shape[1]))
        padded[: self.size] = flat
        y = padded.reshape(count, _BLOCK, -1)
        for k in range(count):
            if k:
                y[k] -= self.link[k - 1].T @ y[k - 1]
            y[k] = self.inverse[k] @ y[k]
        for k in reversed(range(count)):
            if k + 1 < count:
                y[k] -= self.link[k] @ y[k + 1]
            y[k] = self.inverse[k].T @ y[k]
        return np.asarray(padded[: self.size].reshape(shape))
