"""Scores of candidate columns beside what the regression already knows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .batch import Blocks
from .extension import Extension
from .leastsquares import ROUNDING, LeastSquares
from .runcolumns import RunEffectColumns
from .whitening import RunEffect

__all__ = ["BEYOND_SHOWN", "EXCITED", "ROUNDING", "Extension", "Regression"]

Array = NDArray[np.float64]

#: Times the standard deviation of the residual beyond which no cause is as large.
BEYOND_SHOWN = 3.0

#: Times what a coarse search finds that the refined one may. Where the noise is correlated a
#: search that does not whiten has its peaks elsewhere: three times was seen.
REFINED = 4.0

#: Share of a column's power that must be left after projection for it to count at all.
EXCITED = 1e-4


class Regression(LeastSquares):
    """Readings, what the simulation expects of them, the terms chosen so far, and scores.

    What a candidate would save is computed for its columns projected beside the others
    (Frisch and Waugh), all of a search at once. Parameters are those of `LeastSquares`.
    """

    def projected(self, columns: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Whitened columns with what is known taken out, and which are excited."""
        x = self.whiten(columns)
        before = np.einsum("ij,ij->j", x, x)
        x = x - self.q @ (self.q.T @ x)
        after = np.einsum("ij,ij->j", x, x)
        return x, after > EXCITED * np.maximum(before, 1e-300)

    def beside(self, columns: Array, spread: float = np.inf) -> Self:
        r"""The same regression with ``columns`` fitted too, for scores of others beside them.

        With a finite ``spread`` their coefficients are drawn from a normal distribution of that
        standard deviation about zero: a column that the readings tell worse than that is fitted
        in part. Scores stay those of generalised least squares: with the covariance
        :math:`I + U S^2 U^T` of columns and noise, :math:`U S^2/(1 + S^2) U^T` is taken out.
        """
        x, excited = self.projected(columns)
        u, s, _ = np.linalg.svd(x[:, excited], full_matrices=False)
        kept = s > EXCITED * s.max(initial=0.0)
        u, s = u[:, kept], s[kept]
        share = np.ones_like(s)
        if np.isfinite(spread):
            power = (s * spread) ** 2 / self.variance
            share = power / (1.0 + power)
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.memory, other._asked = {}, None
        other.q = np.hstack([self.q, u * np.sqrt(share)])
        moment = u.T @ self.r
        other.r = self.r - u @ (share * moment)
        other.rss = max(float(self.r @ other.r), 1e-300)
        other._seen = None
        return other

    def _beside(self, columns: Array) -> tuple[Array, Array, Array, Array]:
        """Whitened columns, their powers before and after projection, their known shares."""
        x = self.whiten(columns)
        before = np.einsum("ij,ij->j", x, x)
        known = self.q.T @ x
        return x, before, before - np.einsum("ij,ij->j", known, known), known

    def gain(self, columns: Array) -> tuple[float, Array]:
        """Deviance that ``columns`` save together, and their coefficients."""
        x, before, after, known = self._beside(columns)
        coefficients = np.zeros(columns.shape[1])
        if not (after > EXCITED * np.maximum(before, 1e-300)).all():
            return 0.0, coefficients
        gram = x.T @ x - known.T @ known
        scale = np.sqrt(np.diag(gram))
        values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        if values[0] < EXCITED * values[-1]:
            return 0.0, coefficients
        moment = vectors.T @ (x.T @ self.r / scale)
        saved = float(np.sum(moment**2 / values))
        coefficients = (vectors @ (moment / values)) / scale
        return self.as_deviance(saved), coefficients

    def coefficients_with(self, extension: Extension) -> Array:
        """Coefficients of all terms so far if a extension joined them."""
        moved = self.back @ (self.q.T @ self.whiten(extension.columns))
        return np.asarray(self.coefficients - moved @ extension.coefficients)

    def gains(self, columns: Array) -> Array:
        """Deviance that each column saves alone."""
        x, before, after, _ = self._beside(columns)
        excited = after > EXCITED * np.maximum(before, 1e-300)
        saved = (x.T @ self.r) ** 2 / np.where(excited, after, 1.0)
        return np.where(excited, self.as_deviances(np.where(excited, saved, 0.0)), 0.0)

    def block_gains(self, blocks: Blocks) -> Array:
        """Deviance that each block of columns saves alone, as `gain` of each."""
        found = np.zeros(blocks.count)
        q, r = self.seen
        for where, products in blocks.groups:
            columns, width = products.columns, products.width
            before = products.under(self.whiten)
            known = (q.T @ columns).reshape(q.shape[1], -1, width)
            moment = (r @ columns).reshape(-1, width)
            after = before - np.einsum("kbi,kbj->bij", known, known)
            power = np.einsum("bii->bi", after)
            limit = EXCITED * np.maximum(np.einsum("bii->bi", before), 1e-300)
            excited = (power > limit).all(axis=1)
            scale = np.sqrt(np.where(excited[:, None], power, 1.0))
            values, vectors = np.linalg.eigh(after / (scale[:, :, None] * scale[:, None, :]))
            excited &= values[:, 0] > EXCITED * values[:, -1]
            turned = np.einsum("bij,bi->bj", vectors, moment / scale)
            saved = np.sum(turned**2 / np.where(excited[:, None], values, 1.0), axis=1)
            found[where] = self.as_deviances(np.where(excited, saved, 0.0))
        return found

    def remembered(self, name: str, key: object, build: Callable[[], Any]) -> Any:
        """`LineBasis.once` of what depends on the pattern, too."""
        pattern = self.around.pattern
        parts = (pattern.orders, pattern.cosine, pattern.sine)
        return self.lines.once(name, (key, *(part.tobytes() for part in parts)), build)

    def asked(self, key: object, build: Callable[[], Any]) -> Any:
        """What ``build`` makes of this regression and its terms, made once; itself perhaps."""
        if self._asked is None or self._asked[0] is not self.r:
            self._asked = self.r, {}
        answers = self._asked[1]
        if key not in answers:
            made = build()
            # Not itself: who holds itself is not let go of.
            answers[key] = None if made is self else made
        return self if answers[key] is None else answers[key]

    def fixed_gains(self, columns: Array) -> Array:
        """Deviance that each column saves with the coefficient 1."""
        x, before, after, _ = self._beside(columns)
        excited = after > EXCITED * np.maximum(before, 1e-300)
        saved = 2.0 * (x.T @ self.r) - after
        return np.where(excited, self.as_deviances(saved), 0.0)

    def line_gains(self) -> Array:
        """Deviance that a line of each order of `lines` saves (two coefficients)."""
        before = self.lines.products.under(self.whiten)
        cosines, sines, mixed = before[:, 0, 0], before[:, 1, 1], before[:, 0, 1]
        # Cosines and sines side by side.
        q, r = (columns.astype(np.float32) for columns in self.seen)
        known = (q.T @ self.lines.values).astype(np.float64)
        moment = (r @ self.lines.values).astype(np.float64)
        aa = cosines - (known[:, 0::2] ** 2).sum(axis=0)
        bb = sines - (known[:, 1::2] ** 2).sum(axis=0)
        ab = mixed - (known[:, 0::2] * known[:, 1::2]).sum(axis=0)
        determinant = aa * bb - ab**2
        c, s = moment[0::2], moment[1::2]
        excited = determinant > 1e-3 * (0.5 * (cosines + sines)) ** 2
        saved = (bb * c * c - 2.0 * ab * c * s + aa * s * s) / np.where(excited, determinant, 1.0)
        return np.where(excited, self.as_deviances(np.maximum(saved, 0.0)), 0.0)

    def propose(
        self,
        cause: str,
        shape: dict[str, Any],
        columns: Array,
        parameters: int | None = None,
        log_grid: float = 0.0,
        deviance: float | None = None,
        line: float | None = None,
    ) -> Extension:
        """Extension of regressors with their evidence in this regression.

        None is given for an error larger than the readings show: it would only be there to
        be taken off again by another one.
        """
        saved, coefficients = self.gain(columns)
        if float(np.std(columns @ coefficients)) > BEYOND_SHOWN * float(np.std(self.residual)):
            saved = 0.0
            deviance = None if deviance is None else 0.0
        return Extension(
            cause,
            shape,
            columns,
            columns.shape[1] if parameters is None else parameters,
            log_grid,
            saved if deviance is None else deviance,
            self.log_n,
            coefficients=coefficients,
            line=line,
        )

    def propose_run_effect(
        self,
        cause: str,
        shape: dict[str, Any],
        columns: Array | RunEffectColumns,
        log_grid: float = 0.0,
    ) -> Extension:
        """Extension of a run effect with its evidence in this regression."""
        if not isinstance(columns, RunEffectColumns):
            columns = RunEffectColumns(columns, self.bounds)
        ratio, deviance = self.ratio_of(columns)
        return Extension(
            cause,
            shape,
            np.zeros((self.n, 0)),
            1,
            log_grid,
            deviance,
            self.log_runs,
            RunEffect(columns.columns, ratio),
        )

    def hopeless(self, deviance: float, parameters: int, log_grid: float = 0.0) -> bool:
        """A coarse search this far below its penalty gains nothing by refining."""
        return 1.5 * deviance + 10.0 < parameters * self.log_n + 2.0 * log_grid

    def beaten(self, deviance: float, parameters: int, log_grid: float = 0.0) -> bool:
        """A coarse search so far below `least` is not refined to what another one explains."""
        price = parameters * self.log_n + 2.0 * log_grid + self.least
        return self.least > 0.0 and REFINED * deviance + 10.0 < price
