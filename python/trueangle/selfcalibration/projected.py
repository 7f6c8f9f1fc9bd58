"""The one estimator: unknown harmonics jointly with nuisances, their covariance, null vectors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

#: A column is not identifiable where nuisances and other columns leave less of its square.
#: Below this share rounding in the sums (1e-16 of a column, times its condition) decides.
NOT_SEEN = 1e-9


#: A column that retains less is not determined: its standard error is 30 times that of it alone.
TOLD = 1e-3


class Unknown(NamedTuple):
    """What an unknown is: ``order`` 3 of ``"the encoder"``, its cosine or sine."""

    source: str
    order: float
    part: str
    """``"cos"`` or ``"sin"``; ``""`` for a column that is not a harmonic."""

    def __str__(self) -> str:
        return f"order {self.order:g} of {self.source}" if self.part else self.source


def harmonic_unknowns(source: str, orders: Iterable[float]) -> list[Unknown]:
    """Cosine and sine columns of each order of one source."""
    return [Unknown(source, float(k), part) for k in orders for part in ("cos", "sin")]


def harmonic_rows(
    theta: Array,
    orders: Sequence[float],
    out: Array | None = None,
    *,
    factor: Array | None = None,
    lead: Array | None = None,
) -> Array:
    """``cos k theta, sin k theta`` of each whole order in turn, shape (2 orders, n).

    Neighbouring orders are made by one complex product each: within ``k`` roundings.
    With ``lead`` the phase ``lead / k`` is added, with ``factor`` each reading is scaled.
    """
    rows = np.empty((2 * len(orders), theta.size)) if out is None else out
    whole = [int(k) for k in orders]
    _core.harmonic_rows(np.ascontiguousarray(theta), whole, rows, factor, lead)
    return rows


def harmonic_sum(
    theta: Array,
    orders: Sequence[float],
    coefficients: Array,
    *,
    factor: Array | None = None,
    lead: Array | None = None,
) -> Array:
    """``coefficients @ harmonic_rows(...)`` without the rows."""
    out = np.empty(theta.size)
    whole = [int(k) for k in orders]
    _core.harmonic_sum(theta, whole, np.ascontiguousarray(coefficients), out, factor, lead)
    return out


def combinations(
    information: Array, alone: Array, floor: float
) -> tuple[Array, Array, Array, Array]:
    """Columns' scale; shares retained by identifiable combinations, these; and the others."""
    scale = _scale(alone)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    kept = values >= floor
    return scale, values[kept], vectors[:, kept], vectors[:, ~kept]


def _scale(alone: Array) -> Array:
    return np.asarray(1.0 / np.sqrt(np.where(alone > 0.0, alone, 1.0)))


@dataclass(frozen=True)
class Projected:
    """Least squares for the columns that matter, after the nuisances are eliminated.

    Parameters
    ----------
    columns : sequence of Column
    information : ndarray, shape (m, m)
        ``Xᵀ (I - Π) X``, with the nuisances (and their priors) projected out.
    right : ndarray, shape (m,)
        ``Xᵀ (I - Π) y``.
    alone : ndarray, shape (m,)
        ``x_jᵀ x_j``: the information on each column without the others.
    variance : float
        Of one reading, about the fit.
    freedom : float
        Degrees of freedom behind it.
    """

    columns: tuple[Unknown, ...]
    information: Array
    right: Array
    alone: Array
    variance: float
    freedom: float
    floor: float = NOT_SEEN
    """Combinations that retain less count as not identifiable."""
    design: Projected | None = None
    """Decides which combinations are identifiable, where noise of these columns hides it."""

    @cached_property
    def _eigen(self) -> tuple[Array, Array, Array, Array]:
        """Columns' scale; shares retained by identifiable combinations, these; and the others."""
        if self.design is None:
            return combinations(self.information, self.alone, self.floor)
        scale = _scale(self.alone)
        scaled = self.information * np.outer(scale, scale)
        _, _, basis, lost = self.design._eigen
        values, vectors = np.linalg.eigh(basis.T @ scaled @ basis)
        return scale, np.maximum(values, np.finfo(float).tiny), basis @ vectors, lost

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Columns that take part in identifiable combinations only."""
        lost = (self._eigen[3] ** 2).sum(axis=1)
        # A column with more of its square in unidentifiable combinations is not identifiable.
        return np.asarray(lost < 0.01)

    @cached_property
    def inverse(self) -> Array:
        """Pseudo-inverse of the information over the identifiable combinations."""
        scale, values, vectors, _ = self._eigen
        half = (scale[:, None] * vectors) / np.sqrt(values)
        return np.asarray(half @ half.T)

    @property
    def solution(self) -> Array:
        """The unknowns; of least norm along combinations that are not identifiable."""
        return np.asarray(self.inverse @ self.right)

    @property
    def covariance(self) -> Array:
        """``variance * inverse``."""
        return self.variance * self.inverse

    def retained(self, among: Sequence[int] | None = None) -> Array:
        """Share of each column's square that nothing else explains.

        ``1 / (A⁻¹_jj x_jᵀ x_j)``: 1 where it is alone, 0 where it is not identifiable.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1.0 / (np.diagonal(self.inverse) * self.alone)
        share = np.where(self.seen, np.minimum(share, 1.0), 0.0)
        return share if among is None else share[list(among)]

    @cached_property
    def told(self) -> NDArray[np.bool_]:
        """Columns that retain at least a thousandth in the design."""
        return np.asarray((self.design or self).retained() >= TOLD)

    @property
    def rank(self) -> int:
        """Number of identifiable combinations."""
        return int(self._eigen[1].size)

    def index(self, source: str, order: float) -> tuple[int, int]:
        """Places of the cosine and sine columns."""
        first = self.columns.index(Unknown(source, float(order), "cos"))
        return first, first + 1
