"""What a quadratic form of residuals is where the readings hold white noise only.

A fit takes the space of its columns from the readings, and leaves ``r = M e`` with
``M = I - Q Qᵀ`` and an orthonormal basis Q of the columns. For white noise e then

::

    E[rᵀ A r] / E[rᵀ r] = tr(M A) / tr(M),
    var(rᵀ A r / rᵀ r) ≈ 2 [tr(M A M A) - tr(M A)² / tr(M)] / tr(M)²

Source: Durbin and Watson, Testing for serial correlation in least squares regression,
Biometrika 37 (1950) 409, for their statistic, which is one of these. What a fit does to the
correlation of neighbours so depends on its orders: low ones leave it too low, and high ones too
high.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from ..support.arrays import Array
from .problem import Problem

#: Readings times columns up to which the columns are written out.
_MOST: Final = 4_000_000
#: Columns in square roots of readings below which the fit changes no such form by a tenth of
#: what is looked for: its share of the noise is then far below the form's own deviation.
_SLIGHT: Final = 0.3
#: Part of the largest eigenvalue below which columns add nothing new.
_RANK: Final = 1e-10


class Share(NamedTuple):
    """Expected ``rᵀ A r / rᵀ r`` of white noise, and its standard deviation."""

    expected: float
    deviation: float


class ResidualSpace:
    """The space that a fit has taken from its readings.

    Parameters
    ----------
    basis : ndarray, shape (n, m)
        Orthonormal columns; readings run after run in the order of time.
    sizes : sequence of int
        Readings of each run.
    """

    def __init__(self, basis: Array, sizes: Sequence[int]) -> None:
        self._basis, self._sizes = basis, tuple(sizes)

    @classmethod
    def of(
        cls, problem: Problem, weights: Sequence[Array | None], used: Sequence[int]
    ) -> ResidualSpace | None:
        """That of a fit of these runs; None of sums, of no orders, and where readings abound."""
        sizes = [len(problem.runs[i]) for i in used]
        width = problem.unknowns + len(used)
        if not problem.unknowns or problem.summed or sum(sizes) * width > _MOST:
            return None
        if width < _SLIGHT * math.sqrt(sum(sizes)):
            return None
        own = [problem.private(i) for i in used]
        starts = np.cumsum([0, *(part.shape[1] for part in own)])
        rows = []
        for place, i in enumerate(used):
            alone = np.zeros((sizes[place], starts[-1]))
            alone[:, starts[place] : starts[place + 1]] = own[place]
            columns = np.hstack([alone, problem.columns(i)])
            weight = weights[i]
            rows.append(columns if weight is None else np.sqrt(weight)[:, None] * columns)
        columns = np.vstack(rows)
        columns /= np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
        values, vectors = np.linalg.eigh(columns.T @ columns)
        kept = values > _RANK * values[-1]
        return cls(columns @ (vectors[:, kept] / np.sqrt(values[kept])), sizes)

    def neighbours(self) -> Share:
        """Of the products of neighbours in each run."""
        pairs = sum(self._sizes) - len(self._sizes)
        return self._share(self._next, 0.0, 0.5 * pairs)

    def means(self, length: int) -> Share:
        """Of the squared means of ``length`` neighbours, times their number."""
        blocks = sum(size // length for size in self._sizes)

        def spread(columns: Array) -> Array:
            found = np.zeros_like(columns)
            for part, out in zip(self._runs(columns), self._runs(found), strict=True):
                whole = len(part) // length * length
                means = part[:whole].reshape(-1, length, part.shape[1]).mean(axis=1)
                out[:whole] = np.repeat(means, length, axis=0)
            return found

        return self._share(spread, float(blocks), float(blocks))

    def _next(self, columns: Array) -> Array:
        """Half of both neighbours of each row."""
        found = np.zeros_like(columns)
        for part, out in zip(self._runs(columns), self._runs(found), strict=True):
            out[1:] += 0.5 * part[:-1]
            out[:-1] += 0.5 * part[1:]
        return found

    def _runs(self, columns: Array) -> list[Array]:
        return np.split(columns, np.cumsum(self._sizes)[:-1])

    def _share(self, form: Callable[[Array], Array], trace: float, square: float) -> Share:
        """By A itself, its trace and that of its square."""
        left = len(self._basis) - self._basis.shape[1]
        if left < 1:
            return Share(0.0, math.inf)
        turned = form(self._basis)
        inner = self._basis.T @ turned
        first = trace - float(np.trace(inner))
        second = square - 2.0 * float((turned**2).sum()) + float((inner**2).sum())
        variance = 2.0 * max(second - first**2 / left, 0.0)
        return Share(first / left, math.sqrt(variance) / left)
