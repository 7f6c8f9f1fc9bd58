"""What a fit of readings tells of its coefficients, and what the fit would be without some."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import Pattern, Surroundings
from ..support.quantiles import median
from .extension import Extension
from .whitening import Whitener

__all__ = ["ENOUGH_RUNS", "Coefficients"]

Array = NDArray[np.float64]

#: Runs from which they, and not the readings, are what informs on a variance between runs.
ENOUGH_RUNS = 8

#: Residuals are taken at most this many robust standard deviations large: outliers
#: must not make causes, and normal ones are not touched.
CLIP = 4.0


class Coefficients:
    """Coefficients of the simulation's own columns and of terms, with their covariances."""

    n: int
    bounds: list[tuple[int, int]]
    weights: Array | None
    belief: Surroundings
    fixed_rho: float | None
    residual: Array
    base: Array
    terms: list[Extension]
    design: Array
    whiten: Whitener
    q: Array
    back: Array
    r: Array
    rss: float
    coefficients: Array
    #: Covariance of all coefficients by what the forms of the terms leave, where known.
    form_errors: Array | None

    @property
    def root_weights(self) -> Array:
        """Square roots of the weights."""
        return np.ones(self.n) if self.weights is None else np.sqrt(self.weights)

    @property
    def variance(self) -> float:
        """Variance of one reading's noise, arcsec squared."""
        return float(self.rss / max(self.n - self.q.shape[1], 1))

    @property
    def unscaled_covariance(self) -> Array:
        """Covariance of all coefficients over the variance of one reading."""
        return np.asarray(self.back @ self.back.T)

    def fitted(self) -> list[tuple[Extension, Array]]:
        """Every term with its coefficients."""
        return [(term, self.coefficients[self.place(k)]) for k, term in enumerate(self.terms)]

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

    def clipped(self, coefficients: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """What coefficients leave, outliers clipped; readings to match; which are outlying."""
        left = self.residual - self.design @ coefficients
        left -= self.whiten.run_part(left)
        scale = self.root_weights * left
        spread = 1.4826 * float(median(np.abs(scale - median(scale))))
        limit = CLIP * max(spread, 1e-12) / self.root_weights
        outlying = np.abs(left) > limit
        if 2 * np.count_nonzero(outlying) > outlying.size:
            # More than half read alike, and away from the mean: no outlier is in the majority.
            limit = CLIP * 1.4826 * float(median(np.abs(scale))) / self.root_weights
            outlying = np.abs(left) > limit
        kept = np.clip(left, -limit, limit)
        return kept, np.where(outlying, self.residual - left + kept, self.residual), outlying

    def coefficients_without(self, group: Sequence[int]) -> Array:
        r"""Coefficients of all columns where those of the terms ``group`` are held at 0.

        .. math:: \beta - C_{\cdot g} C_{gg}^{-1} \beta_g, \quad C = (X^T M^T M X)^{-1}

        under the noise of this fit, which may have a fixed correlation and none of the terms
        ``group`` a run effect of its own; outliers are clipped as in the fit of the others.
        """
        held = np.concatenate([self.place(k) for k in group])
        spread = self.unscaled_covariance[:, held]
        moved = spread @ np.linalg.pinv(spread[held])

        def solved(target: Array) -> Array:
            found = self.back @ (self.q.T @ self.whiten(target))
            return np.asarray(found - moved @ found[held])

        coefficients = solved(self.residual)
        for _ in range(2):
            _, target, outlying = self.clipped(coefficients)
            if not outlying.any():
                break
            coefficients = solved(target)
        return coefficients

    def surroundings(self, fitted: Sequence[tuple[Extension, Array]]) -> Surroundings:
        """The joint, with the believed pattern and the missing orders among the terms.

        Not with the fitted corrections: an effect on the pattern (a filter) would be
        taken for one in part, and then act on a pattern that it has already changed.
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
        return Surroundings(self.belief.joint, pattern)
