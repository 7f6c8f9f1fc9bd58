"""The readings with what is already known projected out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import Pattern, Surroundings, line_columns
from ..joint.signals import Signals
from ..quantiles import median
from .extension import Extension, penalty_of_parameter
from .factor import Factor
from .lines import LineBasis
from .ratio import best_ratio
from .repeats import repeated_part
from .runcolumns import RunColumns
from .whitening import LagCorrelation, RunEffect

__all__ = ["ROUNDING", "LeastSquares"]

Array = NDArray[np.float64]

#: Residuals are taken at most this many robust standard deviations large: outliers
#: must not make causes, and normal ones are not touched.
CLIP = 4.0

#: Arcsec below which what is left is the rounding of angles (1e-12 of a turn).
ROUNDING = 1e-6

#: Runs from which they, and not the readings, are what informs on a variance between runs.
ENOUGH_RUNS = 8


class LeastSquares:
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
        blocks = [self.base, *(term.columns for term in self.terms)]
        self.design = design = np.hstack(blocks) if len(blocks) > 1 else self.base
        effects = [term.run_effect for term in self.terms if term.run_effect is not None]
        target, rho = self.residual, self.fixed_rho or 0.0
        for _ in range(2):
            self._project(target, rho, effects)
            left = self.residual - design @ self.coefficients
            left -= self.whiten.run_part(left)
            scale = self.root_weights * left
            spread = 1.4826 * float(median(np.abs(scale - median(scale))))
            limit = CLIP * max(spread, 1e-12) / self.root_weights
            outlying = np.abs(left) > limit
            if self.fixed_rho is None:
                kept = np.clip(left, -limit, limit) * self.root_weights
                rho = self.correlation(kept)
            settled = not outlying.any() and rho == self.whiten.rho
            if settled:
                break
            target = np.where(
                outlying, self.residual - left + np.clip(left, -limit, limit), self.residual
            )
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
        self.around = Surroundings(self.belief.joint, self._pattern())

    @property
    def root_weights(self) -> Array:
        """Square roots of the weights."""
        return np.ones(self.n) if self.weights is None else np.sqrt(self.weights)

    def _project(self, target: Array, rho: float, effects: list[RunEffect]) -> None:
        """Fit the design to ``target`` under this noise."""
        blocks = [self.base, *(term.columns for term in self.terms)]
        factor = Factor.of(
            blocks, self.bounds, rho, effects, self.weights, self._factors, self.design
        )
        # White and correlated noise take turns: the last two are kept.
        self._factors = (factor, *(f for f in self._factors if f.whiten is not factor.whiten))[:2]
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

    @property
    def unscaled_covariance(self) -> Array:
        """Covariance of all coefficients over the variance of one reading."""
        return np.asarray(self.back @ self.back.T)

    def _refit_ratio(
        self, target: Array, rho: float, effects: list[RunEffect], k: int
    ) -> RunEffect:
        others = [effect for j, effect in enumerate(effects) if j != k]
        self._project(target, rho, others)
        columns = effects[k].columns
        ratio, _ = self.ratio_of(RunColumns(columns, self.bounds))
        return RunEffect(columns, max(ratio, 1e-9))

    def ratio_of(self, columns: RunColumns) -> tuple[float, float]:
        """Best ratio of variances of a run effect beside what is fitted, and what it saves."""
        moments = columns.moments(self._all_seen())
        return best_ratio(columns.grams(self.whiten), moments, self.as_deviances)

    def _pattern(self) -> Pattern:
        """The believed pattern with the missing orders found so far.

        Not with the fitted corrections: an effect on the pattern (a filter) would be
        taken for one in part, and then act on a pattern that it has already changed.
        """
        belief = self.belief.pattern
        orders = [*belief.orders]
        pairs = [*zip(belief.cosine, belief.sine, strict=True)]
        for term, coefficients in self.fitted():
            if term.line is not None:
                orders.append(term.line)
                pairs.append((coefficients[0], coefficients[1]))
        array = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        return Pattern(np.array(orders, dtype=np.float64), array[:, 0], array[:, 1])

    def fitted(self) -> list[tuple[Extension, Array]]:
        """Every term with its coefficients."""
        found = []
        start = self.base.shape[1]
        for term in self.terms:
            stop = start + term.columns.shape[1]
            found.append((term, self.coefficients[start:stop]))
            start = stop
        return found

    def place(self, k: int) -> NDArray[np.int64]:
        """Columns of term ``k`` among those of the design."""
        start = self.base.shape[1] + sum(t.columns.shape[1] for t in self.terms[:k])
        return np.arange(start, start + self.terms[k].columns.shape[1])

    def covariance(self, k: int) -> Array:
        """Covariance of the coefficients of term ``k``."""
        where = self.place(k)
        return np.asarray(self.unscaled_covariance[np.ix_(where, where)] * self.variance)

    def robust_covariance(self, k: int) -> Array:
        """Covariance of the coefficients of term ``k``, widened by what its form leaves."""
        return self.robust(self.place(k))

    def sum_variance(self, terms: Sequence[Extension]) -> float:
        """Variance of the sum of all coefficients of some of the terms, widened alike."""
        places = [self.place(k) for k, term in enumerate(self.terms) if term in terms]
        return float(self.robust(np.concatenate(places)).sum())

    def robust(self, where: NDArray[np.int64]) -> Array:
        r"""Covariance of some coefficients, at least as wide as runs disagree on them.

        .. math:: V_s = \frac{R}{R - 1}\sum_j s_j s_j^T, \quad s_j = X^+_j r_j

        with the residuals r of run j: no form is exact, and what it leaves is alike within a
        run. Coefficients whose variance is larger by this than by the noise alone are
        widened to it; from `ENOUGH_RUNS` runs on. `form_errors`, where known, come on top.
        """
        among = np.ix_(where, where)
        plain = np.asarray(self.unscaled_covariance[among] * self.variance)
        beyond = 0.0 if self.form_errors is None else self.form_errors[among]
        runs = len(self.bounds)
        if runs < ENOUGH_RUNS or not plain.size:
            return np.asarray(plain + beyond)
        scores = np.array(
            [self.back[where] @ (self.q[a:b].T @ self.r[a:b]) for a, b in self.bounds]
        )
        between = (scores**2).sum(axis=0) * runs / (runs - 1.0)
        wider = np.sqrt(np.maximum(between / np.maximum(np.diag(plain), 1e-300), 1.0))
        return np.asarray(plain * np.outer(wider, wider) + beyond)

    @property
    def variance(self) -> float:
        """Variance of one reading's noise, arcsec squared."""
        return float(self.rss / max(self.n - self.q.shape[1], 1))

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
