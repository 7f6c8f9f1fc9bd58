"""The readings with what is already known projected out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import Surroundings, line_columns
from ..joint.signals import Signals
from .coefficients import ENOUGH_RUNS, Coefficients
from .extension import Extension, penalty_of_parameter
from .factor import Factor, in_common
from .lines import LineBasis
from .ratio import best_ratio
from .repeats import repeated_part
from .runcolumns import RunEffectColumns
from .whitening import LagCorrelation, RunEffect

__all__ = ["ROUNDING", "LeastSquares"]

Array = NDArray[np.float64]

#: Arcsec below which what is left is the rounding of angles (1e-12 of a turn).
ROUNDING = 1e-6


class LeastSquares(Coefficients):
    """Readings, what the simulation expects of them, and the terms chosen so far.

    Parameters
    ----------
    signals : Signals
    residual : ndarray
        Measured minus simulated error, arcsec, unfolded.
    around : Surroundings
        The joint and the pattern that the simulation believes.
    weights : ndarray, optional
    lines : LineBasis, optional
        Shared between regressions of the same readings.
    """

    def __init__(
        self,
        signals: Signals,
        residual: Array,
        around: Surroundings,
        weights: Array | None = None,
        lines: LineBasis | None = None,
        rho: float | None = None,
    ) -> None:
        self.signals = signals
        self.residual = residual
        self.belief = around
        self.around = around
        self.weights = weights
        self.fixed_rho = rho
        self.bounds = signals.run_bounds()
        self.n = len(signals)
        self.log_n = penalty_of_parameter(self.n)
        runs = len(self.bounds)
        #: What a variance between runs costs.
        self.log_runs = float(np.log(runs)) if runs >= ENOUGH_RUNS else self.log_n
        self.lines = lines if lines is not None else LineBasis(signals.theta, around.joint)
        self.base = np.column_stack(
            [np.ones(self.n), *(line_columns(signals.theta, m) for m in around.pattern.orders)]
        )
        self.terms: list[Extension] = []
        #: Covariance of all coefficients by what the forms of the terms leave, where known.
        self.form_errors: Array | None = None
        self.correlation = LagCorrelation(signals.clock, self.bounds)
        self._factors: tuple[Factor, ...] = ()
        #: What `design` is made of.
        self._blocks: tuple[Array, ...] = (self.base,)
        self.design = self.base
        #: What causes proposed beside given terms; shared by regressions of the same readings.
        self.memory: dict[Any, Any] = {}
        #: Evidence below which no candidate matters at the moment (`Regression.beaten`).
        self.least = 0.0
        #: Answers given, with the residual that they were given for.
        self._asked: tuple[Array, dict[object, Any]] | None = None
        self.update()
        #: `deviance` without any term.
        self.start = self.deviance

    # -- model -------------------------------------------------------------------

    def with_terms(self, terms: Iterable[Extension], rho: float | None = None) -> Self:
        """The same readings with other terms (and this correlation of the noise)."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.terms = list(terms)
        other.form_errors = None
        other.least, other._asked = 0.0, None
        if rho is not None:
            other.fixed_rho = rho
        other.update()
        return other

    def with_evidence(self, terms: Iterable[Extension]) -> Self:
        """The same terms told otherwise: with another deviance, say."""
        terms = list(terms)
        if sum(term.run_effect is not None for term in terms) > 1:
            return self.with_terms(terms)  # ratios of variance settle among each other
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.terms, other._asked = terms, None
        return other

    def without_repeats(self, by_direction: bool = False) -> Self:
        """The regression without what repeats at the same place; itself where nothing does."""
        left = np.where(self.outlying, 0.0, self.left)
        repeated = repeated_part(left, self.signals, by_direction)
        if not repeated.any():
            return self
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.residual = self.residual - repeated
        other.memory, other._asked = {}, None
        other.update()
        other.start = self.start + other.deviance - self.deviance
        return other

    def update(self) -> None:
        """Fit the terms: run effects, correlation, clipping, projection."""
        self.design = design = self._grown_design()
        effects = [term.run_effect for term in self.terms if term.run_effect is not None]
        target, rho = self.residual, self.fixed_rho or 0.0
        for _ in range(2):
            self._project(target, rho, effects)
            clipped, target, outlying = self.clipped(self.coefficients)
            if self.fixed_rho is None:
                rho = self.correlation(clipped * self.root_weights)
            settled = not outlying.any() and rho == self.whiten.rho
            if settled:
                break
        if len(effects) > 1:
            for k in range(len(effects)):
                effects[k] = self._refit_ratio(target, rho, effects, k)
        if len(effects) > 1 or not settled:
            self._project(target, rho, effects)
        self.target, self.outlying = target, outlying
        kept_effects = iter(effects)
        self.terms = [
            replace(term, run_effect=next(kept_effects)) if term.run_effect is not None else term
            for term in self.terms
        ]
        self.left = self.residual - design @ self.coefficients
        self.around = self.surroundings(self.fitted())

    def _grown_design(self) -> Array:
        """All columns side by side; those that the terms before have in common are not moved."""
        blocks = (self.base, *(term.columns for term in self.terms))
        same = in_common(self._blocks, blocks)
        self._blocks = blocks
        kept = self.design[:, : sum(block.shape[1] for block in blocks[:same])]
        further = [block for block in blocks[same:] if block.shape[1]]
        return np.hstack([kept, *further]) if further else kept

    def _project(self, target: Array, rho: float, effects: list[RunEffect]) -> None:
        """Fit the design to ``target`` under this noise."""
        factor = Factor.of(
            self._blocks, self.bounds, rho, effects, self.weights, self._factors, self.design
        )
        # An update passes through white noise and two correlations: all three are kept.
        self._factors = (factor, *(f for f in self._factors if f.whiten is not factor.whiten))[:3]
        self.whiten, self.q, self.back = factor.whiten, factor.q, factor.back
        y = self.whiten(target)
        inner = self.q.T @ y
        self.r = y - self.q @ inner
        self.rss = max(float(self.r @ self.r), 1e-300)
        self.coefficients = self.back @ inner
        self._seen: tuple[Array, Array] | None = None

    def _all_seen(self) -> Array:
        """`seen`, the residual as the last column."""
        if self._seen is None or self._seen[0] is not self.r:
            self._seen = self.r, self.whiten.transposed(np.column_stack([self.q, self.r]))
        return self._seen[1]

    @property
    def seen(self) -> tuple[Array, Array]:
        """The fitted columns and the residual as columns that are not whitened see them."""
        seen = self._all_seen()
        return seen[:, :-1], seen[:, -1]

    def _refit_ratio(
        self, target: Array, rho: float, effects: list[RunEffect], k: int
    ) -> RunEffect:
        others = [effect for j, effect in enumerate(effects) if j != k]
        self._project(target, rho, others)
        columns = effects[k].columns
        ratio, _ = self.ratio_of(RunEffectColumns(columns, self.bounds))
        return RunEffect(columns, max(ratio, 1e-9))

    def ratio_of(self, columns: RunEffectColumns) -> tuple[float, float]:
        """Best ratio of variances of a run effect beside what is fitted, and what it saves."""
        moments = columns.moments(self._all_seen())
        return best_ratio(columns.grams(self.whiten), moments, self.as_deviances)

    @property
    def is_explained(self) -> bool:
        """Nothing but rounding is left (of simulated runs without noise)."""
        return self.variance < ROUNDING**2

    @property
    def deviance(self) -> float:
        """-2 ln of the likelihood, up to a constant of the readings."""
        return float(self.n * np.log(self.rss / self.n)) + float(self.whiten.log_determinant)

    @property
    def bic(self) -> float:
        """Deviance plus the penalty of the terms' parameters and searches."""
        penalty = sum(t.parameters * t.log_n + 2.0 * t.log_grid for t in self.terms)
        return self.deviance + penalty

    def as_deviance(self, saved: float) -> float:
        """``n ln(RSS/(RSS - saved))``."""
        return float(self.as_deviances(np.array([saved]))[0])

    def as_deviances(self, saved: Array) -> Array:
        """`as_deviance` of each."""
        share = np.minimum(saved / self.rss, 1.0 - 1e-15)
        return np.asarray(-self.n * np.log1p(-share))

    def has(self, cause: str) -> bool:
        """A term of this cause is among the terms."""
        return any(term.cause == cause for term in self.terms)
