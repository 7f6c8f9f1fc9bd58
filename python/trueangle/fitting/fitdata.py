"""What was put into a fit, what the core found, and what follows from it by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..runs.run import CalibrationRun
from ..runs.travel import Span
from ..support.arrays import Array
from ..support.plainresult import PlainResult
from .problem import Problem, SolvedProblem
from .robust import RobustFit
from .uncertainty import CovarianceKind, Uncertainty, coefficient_uncertainty

if TYPE_CHECKING:
    from ..estimation.moments import Moments
    from .nuisance import Nuisance
    from .orders.result import OrderSelection
    from .prior import Posterior
    from .summed import SummedReadings


@dataclass(frozen=True, eq=False, repr=False)
class FitData(PlainResult):
    """What a `FitResult` holds."""

    problem: Problem
    fitted: SolvedProblem
    weighted: RobustFit
    loss: str
    ridge: float
    span: Span
    evidence: OrderSelection | None
    joint: tuple[float | None, str]
    remarks: tuple[str, ...] = ()
    covariance_asked: CovarianceKind = "auto"
    nuisance: Nuisance | None = None
    posterior: Posterior | None = None
    known: Uncertainty | None = None

    @property
    def weights(self) -> list[Array] | None:
        """Weights that a robust loss ended with; 0 marks readings rejected as outliers."""
        return self.weighted.weights

    @property
    def readings(self) -> int:
        """Readings of all runs."""
        return self.problem.readings

    @property
    def missing(self) -> int:
        """Rows of the files that an empty cell kept out."""
        if self._summed is not None:
            return self._summed.missing
        return sum(run.left_out for run in self.problem.runs)

    @property
    def moments(self) -> Moments | None:
        """Sums of logs that were fitted in one pass; None where the readings are in memory."""
        return None if self._summed is None else self._summed.moments

    @property
    def runs(self) -> tuple[CalibrationRun, ...]:
        """The runs fitted, as given but for `nuisance`, in parts where counts were lost.

        Raises
        ------
        ArgumentError
            The readings were too many to keep.
        """
        if self._summed is not None:
            raise ArgumentError(
                f"the {self.readings} readings were summed in one pass and are not kept: fit runs "
                "in memory (trueangle.fit) for their residuals and plots"
            )
        return tuple(self.problem.runs)

    @property
    def _summed(self) -> SummedReadings | None:
        return self.problem.summed

    @property
    def offsets(self) -> Array:
        """Zero of every run, a nuisance of the fit; the constant is their circular mean."""
        return self.fitted.offsets

    @property
    def offset_std(self) -> Array:
        """Standard errors of `offsets`."""
        std = np.full(len(self.problem.runs), np.nan)
        std[np.isfinite(self.offsets)] = self.fitted.solution.offset_std
        return std

    @property
    def residual_variance(self) -> float:
        """Weighted sum of squared residuals over `degrees_of_freedom`."""
        return self.fitted.solution.residual_variance

    @property
    def rms_before(self) -> float:
        """Rms of the errors about the zeros of their runs, before any correction."""
        errors = []
        for run, w in zip(self.problem.runs, self.weights or self.problem.base, strict=True):
            error = run.centred_error if w is None else run.centred_error[w > 0.0]
            if error.size:
                errors.append(error - error.mean())
        return float(np.std(np.concatenate(errors)))

    @property
    def residual_std(self) -> float:
        """Residual standard deviation, degrees of freedom allowed for."""
        return math.sqrt(self.residual_variance)

    @property
    def degrees_of_freedom(self) -> float:
        """Readings less unknowns; effective (not whole) with a ridge."""
        return self.fitted.solution.degrees_of_freedom

    @property
    def rank(self) -> int:
        """Numerical rank of the design."""
        return self.fitted.solution.rank

    @property
    def condition_number(self) -> float:
        """Of the design with its columns scaled to unit length."""
        return self.fitted.solution.condition_number

    @property
    def method(self) -> str:
        """``"evidence"`` of orders chosen by it, else the core's way: see `fit`."""
        return self.fitted.solution.method

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Covariance, its kind and the degrees of freedom of each coefficient's variance."""
        if self.known is not None:
            return self.known
        if self.posterior is not None:
            covariance = np.asarray(self.fitted.solution.covariance)
            return Uncertainty(
                "white", covariance, np.full(len(covariance), self.posterior.freedom)
            )
        from .repeated import covariance_with_repeats

        weights = self.weights or self.problem.base
        found = coefficient_uncertainty(
            self.problem,
            self.fitted,
            weights,
            self.ridge,
            self.covariance_asked,
            self.nuisance,
            self.loss,
        )
        return covariance_with_repeats(
            found, self.problem, self.fitted, weights, self.ridge, self.covariance_asked
        )

    @cached_property
    def residuals(self) -> Array:
        """Measured less fitted error of every reading, run after run, zeros removed."""
        return np.concatenate(self.problem.residuals(self.fitted)[: len(self.runs)])

    @property
    def wild(self) -> tuple[tuple[str, int], ...]:
        """Label and row (from 0) of every reading that was rejected."""
        if self.weights is None:
            return () if self._summed is None else self._summed.outliers
        return tuple(
            (run.label or str(i), int(row))
            for i, (run, weights) in enumerate(zip(self.runs, self.weights, strict=True), 1)
            for row in np.flatnonzero(
                (weights == 0.0) & (True if run.weights is None else run.weights > 0.0)
            )
        )
