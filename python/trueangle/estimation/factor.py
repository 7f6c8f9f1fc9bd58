"""Orthonormal bases of columns, and Cholesky factors of matrices of a few diagonals."""

from __future__ import annotations

import numpy as np

import trueangle._core as _core

from ..support.arrays import Array
from .whitening import Whitener


def orthonormal_basis(x: Array) -> Array:
    """Columns of length 1 at right angles that span the same."""
    return _core.Factor(Whitener([(0, len(x))]), x).q


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
