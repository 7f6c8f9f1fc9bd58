"""A problem with the nuisances that were taken out of its readings, for what they cost the pattern.

By Frisch and Waugh the coefficients of a pattern are those of its columns less what nuisances
explain of them. Of a drift, which each run has for itself, that is done run by run; what runs share
(ramp, direction, velocity, lines of the reference) is fitted jointly with the pattern. Noise, its
degrees of freedom, and what runs scatter by are those of this joint fit:

::

    cov = σ² (X̃' W X̃)⁻¹,    σ² = Σ w r² / (n - R - p - q),    X̃ = X - N (N' W N)⁺ N' W X

with p coefficients of the pattern, and q of the nuisances.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..estimation.linear import least_squares, pseudo_inverse
from ..support.arrays import Array
from .problem import PlainSolution, Problem, SolvedProblem

if TYPE_CHECKING:
    from .nuisance import Nuisance


class BesideProblem(Problem):
    """The problem of a pattern fitted jointly with nuisances that were removed from the readings.

    ``shared`` and ``own`` are columns of each run: of all runs together, and of itself.
    """

    def __init__(self, problem: Problem, shared: list[Array], own: list[Array]) -> None:
        self.__dict__.update(problem.__dict__)
        self._shared, self._own = shared, own

    @classmethod
    def of(cls, problem: Problem, nuisance: Nuisance) -> BesideProblem | None:
        """With what was taken out; None where that is nothing, or came from a part of the readings.

        A part is looked at where there are too many.
        """
        from .nuisancecolumns import taken_columns

        columns = taken_columns(problem.runs, nuisance)
        return None if columns is None or problem.summed else cls(problem, *columns)

    @property
    def unknowns(self) -> int:
        """Those of the pattern and of nuisances; the zeros of the runs are not counted."""
        return super().unknowns + self.taken

    @property
    def taken(self) -> int:
        """Coefficients of nuisances."""
        return int(self._shared[0].shape[1] + sum(own.shape[1] for own in self._own))

    def columns(self, index: int) -> Array:
        """Cosine and sine of every order, and what runs share."""
        # Size of the columns that runs share, those of the pattern being 1: no penalty restrains
        # them.
        return np.hstack([super().columns(index), 100.0 * self._shared[index]])

    def private(self, index: int) -> Array:
        """The zero of a run, and a separate drift."""
        return np.hstack([super().private(index), self._own[index]])

    def products(self, weights: Sequence[Array | None], index: int) -> Array:
        """As of a problem, of columns and errors less what the run's own nuisances explain."""
        run, weight = self.runs[index], weights[index]
        target = np.column_stack([self.columns(index), run.centred_error])
        own = self.private(index)
        rest = target - own @ least_squares(own, target, weight)
        rows = np.column_stack([np.ones(len(run)), rest])
        given = rows if weight is None else weight[:, None] * rows
        return np.asarray(rows.T @ given)

    def jointly(
        self, fitted: SolvedProblem, weights: Sequence[Array | None], penalty: float = 0.0
    ) -> SolvedProblem:
        """The same fit with the noise and the covariance of the joint one."""
        solution = fitted.solution
        left = solution.degrees_of_freedom - self.taken
        squares = solution.residual_variance * solution.degrees_of_freedom
        variance = squares / left if left > 0.0 else np.inf
        used = [i for i in range(len(self.runs)) if not np.isnan(fitted.offsets[i])]
        parts = [self.products(weights, i) for i in used]
        gram = np.sum(parts, axis=0)[1:-1, 1:-1]
        means = []
        for i in used:
            weight = weights[i]
            means.append(np.average(self.columns(i), axis=0, weights=weight))
        sums = [part[0, 0] for part in parts]
        held = np.zeros(len(gram))
        held[: super().unknowns] = penalty * float(np.sum(sums))
        inverse = pseudo_inverse(gram + np.diag(held))
        covariance = np.zeros((1 + len(gram), 1 + len(gram)))
        covariance[1:, 1:] = inverse @ gram @ inverse
        mean = np.mean(means, axis=0)
        mean[super().unknowns :] = 0.0
        covariance[0, 1:] = covariance[1:, 0] = -covariance[1:, 1:] @ mean
        covariance[0, 0] = np.mean(1.0 / np.array(sums)) / len(used) - mean @ covariance[1:, 0]
        values = {name: getattr(solution, name) for name in PlainSolution._fields}
        values |= {
            "covariance": variance * covariance,
            "residual_variance": variance,
            "degrees_of_freedom": max(left, 1.0),
        }
        return SolvedProblem(PlainSolution(**values), fitted.offsets, self.shafts, self.period)
