"""Readings fitted by terms: coefficients, their covariances, and the fit without some of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import accumulate
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.pattern import JointPattern, Pattern
from ..joint.signals import Signals
from ..support.arrays import Array
from ..support.deadline import current_deadline
from .evidence import noise_information
from .extension import Extension
from .linear import FEWEST_RUNS, NormalEquations, cluster_covariance, moderated_covariance
from .lines import LineBasis
from .projection import Projection, project
from .readings import Readings
from .whitening import RunEffect, Whitener


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Projection):
    """Readings fitted by the simulation's own columns and by terms.

    Attributes
    ----------
    readings : Readings
    terms : tuple of Extension
    fixed_rho : float or None
        Correlation of the noise where it is given; else that of the residual.
    blocks : tuple of ndarray
        What the design is made of: the readings' own columns, those of every term.
    design : ndarray, shape (n, p)
    factors : list of Factor
        Of the noises that the fit passed through, its own first: the next fit begins there.
    target : ndarray
        The readings, outliers clipped.
    outlying : ndarray of bool
    form_errors : ndarray or None
        Covariance of all coefficients by what the forms of the terms leave, where known.
    """

    readings: Readings
    terms: tuple[Extension, ...]
    fixed_rho: float | None
    blocks: tuple[Array, ...]
    design: Array
    factors: list[_core.Factor]
    target: Array
    outlying: NDArray[np.bool_]
    form_errors: Array | None = None

    @classmethod
    def solve(
        cls,
        readings: Readings,
        terms: Iterable[Extension] = (),
        rho: float | None = None,
        before: Solution | None = None,
    ) -> Solution:
        """Fit the terms: run effects, correlation, clipping, projection.

        What a fit ``before`` has made of the columns that both begin with is not made again.
        """
        terms = tuple(terms)
        blocks = (readings.base, *(term.columns for term in terms))
        design = _grown(blocks, before)
        current_deadline().spend(design.size)
        effects = [term.run_effect for term in terms if term.run_effect is not None]
        known = [] if before is None else before.factors
        factors, found, target, outlying = _core.settled(
            design,
            readings.residual,
            readings.root_weights,
            readings.rounding,
            readings.correlation,
            _whitener(readings, rho or 0.0, effects, known),
            rho,
            known,
        )
        if len(effects) > 1:
            correlation = factors[0].whiten.rho
            for k, effect in enumerate(effects):
                others = [other for j, other in enumerate(effects) if j != k]
                whiten = _whitener(readings, correlation, others, known)
                beside = project(_core.Factor(whiten, design), target)
                effects[k] = RunEffect(
                    effect.columns, max(beside.ratio_of(effect.columns)[0], 1e-9)
                )
            factor = _core.Factor(_whitener(readings, correlation, effects, ()), design)
            factors, found = [factor], factor.project(target)
        sizes = iter(effects)
        terms = tuple(
            term if term.run_effect is None else replace(term, run_effect=next(sizes))
            for term in terms
        )
        return Solution(
            factor=factors[0],
            coefficients=found[0],
            r=found[1],
            rss=found[2],
            readings=readings,
            terms=terms,
            fixed_rho=rho,
            blocks=blocks,
            design=design,
            factors=factors,
            target=target,
            outlying=outlying,
        )

    def factor_with(self, extension: Extension) -> _core.Factor:
        """All columns and those of an extension, under the noise of this fit and of its effect."""
        own = [] if extension.run_effect is None else [extension.run_effect]
        effects = [*self.whiten.effects, *own]
        whiten = _whitener(self.readings, self.whiten.rho, effects, self.factors)
        return _core.Factor(whiten, np.hstack([self.design, extension.columns]))

    def with_solution(self, solution: Solution, **changes: Any) -> Self:
        """Another solution with what else this one holds."""
        return replace(self, **fields_of_solution(solution, Solution), **changes)

    # -- of the readings ---------------------------------------------------------

    @property
    def signals(self) -> Signals:
        """Signals of the readings."""
        return self.readings.signals

    @property
    def residual(self) -> Array:
        """Measured minus simulated error, arcsec."""
        return self.readings.residual

    @property
    def belief(self) -> JointPattern:
        """What the simulation assumes of the joint."""
        return self.readings.belief

    @property
    def bounds(self) -> list[tuple[int, int]]:
        """The runs."""
        return self.readings.bounds

    @property
    def lines(self) -> LineBasis:
        """Lines of every order that is searched for."""
        return self.readings.lines

    @property
    def root_weights(self) -> Array:
        """Square roots of the weights."""
        return self.readings.root_weights

    @property
    def base(self) -> Array:
        """Columns of the simulation's own."""
        return self.readings.base

    @property
    def log_n(self) -> float:
        """What a coefficient costs, in units of BIC."""
        return self.readings.log_n

    # -- of the fit --------------------------------------------------------------

    @cached_property
    def left(self) -> Array:
        """The residual of the readings, arcsec."""
        return np.asarray(self.residual - self.design @ self.coefficients)

    @cached_property
    def left_within_runs(self) -> Array:
        """The residual less the estimated run effects, random in every run, arcsec."""
        return np.asarray(self.left - self.whiten.run_part(self.left))

    @property
    def variance_within_runs(self) -> float:
        """Variance of `left_within_runs`, outliers omitted: readings as they are, not whitened."""
        clean = ~self.outlying
        freedom = max(int(np.count_nonzero(clean)) - self.rank, 1)
        return float(np.sum(self.left_within_runs[clean] ** 2)) / freedom

    @cached_property
    def around(self) -> JointPattern:
        """The joint, with the assumed pattern and the missing orders among the terms."""
        return self.surroundings(self.fitted())

    @property
    def bic(self) -> float:
        """Deviance plus the penalty of the terms' parameters and searches."""
        penalty = sum(t.parameters * t.log_n + 2.0 * t.log_grid for t in self.terms)
        return self.deviance + penalty

    @property
    def size(self) -> int:
        """About how many numbers it holds in addition to the readings."""
        return self.design.size + self.n * sum(factor.rank for factor in self.factors)

    def has(self, cause: str) -> bool:
        """A term of this cause is among the terms."""
        return any(term.cause == cause for term in self.terms)

    def fitted(self) -> list[tuple[Extension, Array]]:
        """Every term with its coefficients."""
        return [
            (term, self.coefficients[start : start + term.columns.shape[1]])
            for term, start in zip(self.terms, self._starts, strict=True)
        ]

    def place(self, k: int) -> NDArray[np.int64]:
        """Columns of term ``k`` among those of the design."""
        start = self._starts[k]
        return np.arange(start, start + self.terms[k].columns.shape[1])

    @cached_property
    def _starts(self) -> list[int]:
        """The first column of every term."""
        return [*accumulate(block.shape[1] for block in self.blocks)][: len(self.terms)]

    def covariance(self, k: int) -> Array:
        """Covariance of the coefficients of term ``k``."""
        where = self.place(k)
        return np.asarray(self.unscaled_covariance[np.ix_(where, where)] * self.variance)

    def robust_covariance(self, k: int) -> Array:
        """Covariance of the coefficients of term ``k``, widened by what its form leaves."""
        return self.robust(self.place(k))

    def robust(self, where: NDArray[np.int64]) -> Array:
        """Covariance of some coefficients: of the noise, what runs disagree on, `form_errors`.

        The noise is that of most evidence (`noise_information`): what the map leaves correlated is
        no less noise. Coefficients that the runs scatter by more are widened to that, moderated by
        one another (`moderated_covariance`), since no form is exact, and what it leaves is
        correlated within a run.
        """
        among = np.ix_(where, where)
        noise, scatter = self._covariances
        beyond = 0.0 if self.form_errors is None else self.form_errors[among]
        plain = noise[among]
        ratio = np.diag(scatter)[where] / np.maximum(np.diag(plain), 1e-300)
        wider = np.sqrt(np.maximum(ratio, 1.0))
        return np.asarray(plain * np.outer(wider, wider) + beyond)

    @cached_property
    def _covariances(self) -> tuple[Array, Array]:
        """Of all coefficients, by the noise and by the scatter of the runs."""
        freedom = self.n - self.rank
        if not (self.rss > 0.0 and freedom > 0 and self.rank):
            plain = np.asarray(self.unscaled_covariance * self.variance)
            return plain, plain
        known = noise_information(self.q, self.r, self.bounds, self.rss / freedom)
        own = np.asarray(np.linalg.inv(known))
        noise = self.back @ own @ self.back.T
        if len(self.bounds) < FEWEST_RUNS:
            return noise, noise
        clusters = [NormalEquations.of_rows(self.q[a:b], self.r[a:b]) for a, b in self.bounds]
        scatter = moderated_covariance(cluster_covariance(clusters), own, freedom)
        return noise, self.back @ scatter.covariance @ self.back.T

    def coefficients_with(self, extension: Extension) -> Array:
        """Coefficients of all terms if an extension joined them."""
        moved = self.back @ (self.q.T @ self.whiten(extension.columns))
        return np.asarray(self.coefficients - moved @ extension.coefficients)

    def coefficients_without(self, group: Sequence[int]) -> Array:
        """Coefficients of all columns where those of the terms ``group`` are held at 0.

        ::

            β - C_{·g} C_gg⁻¹ β_g,    C = (Xᵀ Mᵀ M X)⁻¹

        under the noise of this fit. It may have a fixed correlation, and no term of
        ``group`` may have a run effect. Outliers are clipped as in the fit of the others.
        """
        readings = self.readings
        return self.factor.without(
            [int(column) for k in group for column in self.place(k)],
            readings.residual,
            readings.root_weights,
            readings.rounding,
            readings.correlation,
        )

    def surroundings(self, fitted: Sequence[tuple[Extension, Array]]) -> JointPattern:
        """The joint, with the assumed pattern and the missing orders among the terms.

        Not with the fitted corrections: an effect on the pattern (a filter) would be
        partly fitted as one, and then act on a pattern that it has already changed.
        """
        belief = self.belief.pattern
        orders = [*belief.orders]
        pairs = [*zip(belief.cosine, belief.sine, strict=True)]
        for term, coefficients in fitted:
            if term.line is not None:
                orders.append(term.line)
                pairs.append((coefficients[0], coefficients[1]))
        array = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        pattern = Pattern(np.array(orders, dtype=np.float64), array[:, 0], array[:, 1])
        return JointPattern(self.belief.joint, pattern)


def fields_of_solution(solution: Projection, of: type[Projection]) -> dict[str, Any]:
    """Fields of a class of results, with the values that ``solution`` has."""
    return {field.name: getattr(solution, field.name) for field in fields(of)}


def _grown(blocks: tuple[Array, ...], before: Solution | None) -> Array:
    """All columns side by side, one after the other; those of a fit before are not made again."""
    design = np.empty((len(blocks[0]), sum(block.shape[1] for block in blocks)), order="F")
    same, at = 0, 0
    if before is not None:
        same = common_blocks(before.blocks, blocks)
        at = sum(block.shape[1] for block in blocks[:same])
        if at == design.shape[1] == before.design.shape[1]:
            return before.design
        design[:, :at] = before.design[:, :at]
    for block in blocks[same:]:
        design[:, at : at + block.shape[1]] = block
        at += block.shape[1]
    return design


def common_blocks(one: Sequence[Array], other: Sequence[Array]) -> int:
    """How many blocks, the same arrays, two sequences begin with."""
    same = 0
    while same < min(len(one), len(other)) and one[same] is other[same]:
        same += 1
    return same


def _whitener(
    readings: Readings, rho: float, effects: Sequence[RunEffect], known: Sequence[_core.Factor]
) -> Whitener:
    """The map of a noise of readings, that of a factor where it is known."""
    weights = readings.weights
    made = (factor.whiten for factor in known if factor.whiten.has(rho, effects, weights))
    return next(made, None) or Whitener(readings.bounds, rho, effects, weights)
