"""A target with fitted columns projected out, and what others would save with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.pattern import VANISHES
from ..support.arrays import Array
from ..support.deadline import current_deadline
from .blocks import BlockProducts, Blocks
from .whitening import Whitener

#: Arcsec below which the residual is the rounding of angles (1e-12 of a turn).
ROUNDING = 1e-6

#: Share of a column's power that must be left after projection for it to count at all.
EXCITED = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class Projection:
    """A target y fitted by columns X under a noise that M makes white.

    What candidates would save is computed for their columns with the fitted ones projected out
    (Frisch and Waugh), all of a search at once.

    Attributes
    ----------
    factor : Factor
        X under M, made orthonormal; see `whiten`, `q` and `back`.
    r : ndarray, shape (n,)
        The residual of M y.
    rss : float
        Its sum of squares.
    coefficients : ndarray, shape (p,)
    further : ndarray or None
        Columns that are projected out in addition to those of the factor, orthogonal to them.
    """

    factor: _core.Factor
    r: Array
    rss: float
    coefficients: Array
    further: Array | None = None

    @property
    def whiten(self) -> Whitener:
        """M."""
        return self.factor.whiten

    @cached_property
    def q(self) -> Array:
        """Orthonormal columns that span M X, and those projected out in addition."""
        q = self.factor.q
        return q if self.further is None else np.hstack([q, self.further])

    @cached_property
    def back(self) -> Array:
        """B: coefficients of X are ``back @ (q.T @ M y)``."""
        return self.factor.back

    @property
    def rank(self) -> int:
        """Number of independent columns that are projected out."""
        return self.factor.rank + (0 if self.further is None else self.further.shape[1])

    # -- the residual ------------------------------------------------------------

    @property
    def n(self) -> int:
        """Count of the readings."""
        return int(self.r.size)

    @property
    def variance(self) -> float:
        """Variance of one reading's noise, arcsec squared."""
        return float(self.rss / max(self.n - self.rank, 1))

    @property
    def unscaled_covariance(self) -> Array:
        """Covariance of all coefficients over the variance of one reading."""
        return np.asarray(self.back @ self.back.T)

    @property
    def is_explained(self) -> bool:
        """Nothing but rounding is left (of simulated runs without noise)."""
        return self.variance < ROUNDING**2

    @property
    def deviance(self) -> float:
        """-2 ln of the likelihood, up to a constant of the readings."""
        return float(self.n * np.log(self.rss / self.n)) + float(self.whiten.log_determinant)

    def as_deviances(self, saved: Array) -> Array:
        """``n ln(RSS/(RSS - saved))`` of each."""
        share = np.minimum(saved / self.rss, 1.0 - 1e-15)
        return np.asarray(-self.n * np.log1p(-share))

    # -- what others would save --------------------------------------------------

    @cached_property
    def beside(self) -> _core.Beside:
        """What columns that are not whitened see of the fit."""
        return self.whiten.beside(self.q, self.r, self.rss, EXCITED)

    @property
    def seen(self) -> tuple[Array, Array]:
        """The fitted columns, as rows, and the residual as columns not whitened see them."""
        rows = self.beside.seen
        return rows[:-1], rows[-1]

    def projected(self, columns: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Whitened columns with what is fitted taken out, and which are excited."""
        x = self.whiten(columns)
        before = np.einsum("ij,ij->j", x, x)
        x = x - self.q @ (self.q.T @ x)
        after = np.einsum("ij,ij->j", x, x)
        return x, after > EXCITED * np.maximum(before, 1e-300)

    def jointly_with(self, columns: Array, spread: float = np.inf) -> Self:
        """The same with ``columns`` fitted too, for scores of others.

        With a finite ``spread`` their coefficients have a normal prior of that standard deviation
        about zero: a column that the readings determine less well than that is fitted
        in part. Scores stay those of generalised least squares: with the covariance
        ``I + U S² Uᵀ`` of columns and noise, ``U S²/(1 + S²) Uᵀ`` is taken out.
        """
        x, excited = self.projected(columns)
        u, s, _ = np.linalg.svd(x[:, excited], full_matrices=False)
        kept = s > EXCITED * s.max(initial=0.0)
        u, s = u[:, kept], s[kept]
        share = np.ones_like(s)
        if np.isfinite(spread):
            power = (s * spread) ** 2 / self.variance
            share = power / (1.0 + power)
        r = self.r - u @ (share * (u.T @ self.r))
        own = u * np.sqrt(share)
        further = own if self.further is None else np.hstack([self.further, own])
        return replace(self, further=further, r=r, rss=max(float(self.r @ r), 1e-300))

    def of_target(self, target: Array) -> Self:
        """Another target fitted by the same columns."""
        coefficients, r, rss = self.factor.project(target)
        return replace(self, r=r, rss=rss, coefficients=coefficients, further=None)

    def gain(self, columns: Array) -> tuple[float, Array]:
        """Deviance that ``columns`` save together, and their coefficients."""
        current_deadline().spend(columns.size)
        return self.beside.gain(columns)

    def gains(self, columns: Array) -> Array:
        """Deviance that each column saves alone."""
        current_deadline().spend(columns.size)
        before, after, moment = self.beside.powers(columns)
        excited = after > EXCITED * np.maximum(before, 1e-300)
        saved = moment**2 / np.where(excited, after, 1.0)
        return np.where(excited, self.as_deviances(np.where(excited, saved, 0.0)), 0.0)

    def fixed_gains(self, columns: Array) -> Array:
        """Deviance that each column saves with the coefficient 1."""
        before, after, moment = self.beside.powers(columns)
        excited = after > EXCITED * np.maximum(before, 1e-300)
        return np.where(excited, self.as_deviances(2.0 * moment - after), 0.0)

    def block_gains(self, blocks: Blocks) -> Array:
        """Deviance that each block of columns saves alone, as `gain` of each."""
        found = np.zeros(blocks.count)
        q, r = self.seen
        for where, products in blocks.groups:
            columns, width = products.columns, products.width
            before = products.under(self.whiten)
            known = (q @ columns).reshape(len(q), -1, width)
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

    def pair_gains(self, pairs: BlockProducts) -> Array:
        """`block_gains` of cosines and sines side by side, in single precision."""
        before = pairs.under(self.whiten)
        cosines, sines, mixed = before[:, 0, 0], before[:, 1, 1], before[:, 0, 1]
        found = self.beside.seen.astype(np.float32) @ pairs.columns
        known, moment = found[:-1].astype(np.float64), found[-1].astype(np.float64)
        squares = np.square(known).sum(axis=0)
        aa, bb = cosines - squares[0::2], sines - squares[1::2]
        ab = mixed - (known[:, 0::2] * known[:, 1::2]).sum(axis=0)
        determinant = aa * bb - ab**2
        c, s = moment[0::2], moment[1::2]
        excited = determinant > 1e-3 * (0.5 * (cosines + sines)) ** 2
        saved = (bb * c * c - 2.0 * ab * c * s + aa * s * s) / np.where(excited, determinant, 1.0)
        return np.where(excited, self.as_deviances(np.maximum(saved, 0.0)), 0.0)

    def ratio_of(self, columns: Array) -> tuple[float, float]:
        """Best ratio of variances of a run effect beyond what is fitted, and what it saves."""
        current_deadline().spend(columns.size)
        return self.beside.ratio(columns)

    def drawn_line(self, angles: Array, low: float, high: float, steps: int) -> tuple[float, float]:
        """Order in a span of the line with a new phase in every run that saves most, and what.

        It maximises what `ratio_of` reports for the line's columns, by ``steps`` golden sections.
        """
        return self.beside.line(angles, low, high, steps, VANISHES)


def project(factor: _core.Factor, target: Array) -> Projection:
    """A target fitted by a factor's columns."""
    coefficients, r, rss = factor.project(target)
    return Projection(factor=factor, r=r, rss=rss, coefficients=coefficients)
