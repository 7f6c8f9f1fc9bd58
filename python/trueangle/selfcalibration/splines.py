"""Cubic B-splines on uniform knots in time over several segments, and sums over readings of them.

All segments share one list of coefficients; a segment of ``N`` intervals takes ``N + 3``
of them. A reading touches four neighbours, so everything is banded.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array

#: Diagonals of a banded matrix that are kept: the main one and three above it.
BAND = 4

#: A cubic B-spline of twice the width in terms of the finer ones (subdivision).
_MASK = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 8.0

_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
_SECOND = np.array([1.0, -2.0, 1.0])


@dataclass(frozen=True)
class Knots:
    """Intervals of every segment, and where its coefficients begin in the common list."""

    start: tuple[float, ...]
    """Time at which each segment begins, in seconds."""
    intervals: tuple[int, ...]
    spacing: float
    """Seconds between knots, of all segments."""

    @property
    def first(self) -> NDArray[np.int64]:
        """First coefficient of each segment, and the number of all at the end."""
        return np.concatenate([[0], np.cumsum(np.array(self.intervals) + 3)])

    @property
    def size(self) -> int:
        """Coefficients in all."""
        return int(self.first[-1])

    def place(self, stretch: int, time: Array) -> tuple[NDArray[np.int64], Array]:
        """First of the four coefficients that a reading touches, and its place in (0, 1)."""
        x = (time - self.start[stretch]) / self.spacing
        interval = np.clip(x.astype(np.int64), 0, self.intervals[stretch] - 1)
        return interval + self.first[stretch], x - interval

    @property
    def coarser(self) -> Knots:
        """Half as many intervals of twice the length."""
        return Knots(self.start, tuple(n // 2 for n in self.intervals), 2.0 * self.spacing)

    def parents(self) -> NDArray[np.int64]:
        """Finer coefficients behind each coarser one, shape (coarser size, 5).

        ``size`` marks those beyond the ends, which have no readings.
        """
        rows = []
        for first, n in zip(self.first[:-1], self.intervals, strict=True):
            fine = 2 * np.arange(n // 2 + 3)[:, None] - 3 + np.arange(5)
            rows.append(np.where((fine >= 0) & (fine < n + 3), fine + first, self.size))
        return np.concatenate(rows)

    def greville(self) -> Array:
        """Times at which a coefficient is about the value of the spline."""
        return np.concatenate(
            [
                t + self.spacing * (np.arange(n + 3) - 1.0)
                for t, n in zip(self.start, self.intervals, strict=False)
            ]
        )


def spline_basis(place: Array) -> Array:
    """The four cubic B-splines that are not zero at ``place`` in (0, 1), shape (4, n)."""
    u = place
    v = 1.0 - u
    return np.stack(
        [
            v * v * v / 6.0,
            (4.0 - 6.0 * u * u + 3.0 * u**3) / 6.0,
            (4.0 - 6.0 * v * v + 3.0 * v**3) / 6.0,
            u * u * u / 6.0,
        ]
    )


class DriftPenalty:
    """Prior of the motion: the acceleration is noise of one roughness with a correlation time.

    ::

        λ Σ (Δ³ c)² + μ Σ (Δ² c)²,    μ = λ (h/τ)²

    Only constant speed is not penalised; ``tau`` is the correlation time in seconds, ``h`` the
    spacing.
    """

    def __init__(self, knots: Knots) -> None:
        self.knots = knots
        self.third = _squares(knots, _DIFFERENCE)
        self.second = _squares(knots, _SECOND)
        counts = np.array(knots.intervals)
        #: Rank of the prior: all but the straight lines.
        self.rank = int((counts + 1).sum())
        lines = 0.0
        for n in knots.intervals:
            t = (np.arange(n + 3) - 0.5 * (n + 2)) * knots.spacing
            m = n + 3.0
            # log det D D^T of second differences, less that of the lines in time.
            lines += math.log(m * m * (m * m - 1.0) / 12.0) - math.log(m * float(t @ t))
        self._lines = lines
        # Eigenvalues of first differences' squares: those of a path.
        self._path = np.concatenate(
            [2.0 - 2.0 * np.cos(np.pi * np.arange(n + 1) / (n + 1)) for n in knots.intervals]
        )

    def ratio(self, memory: float) -> float:
        """``μ / λ``."""
        return (self.knots.spacing / memory) ** 2

    def bands(self, stiffness: float, memory: float) -> Array:
        """Bands of the prior's matrix."""
        return stiffness * (self.third + self.ratio(memory) * self.second)

    def log_determinant(self, stiffness: float, memory: float) -> float:
        """Of what the prior holds, with the measure of speed and place in seconds."""
        held = float(np.log(self._path + self.ratio(memory)).sum())
        return self.rank * math.log(stiffness) + held + self._lines

    def energy(self, coefficients: Array, memory: float) -> float:
        """The prior's sum of squares at stiffness 1."""
        third = _differences(self.knots, coefficients, 3)
        second = _differences(self.knots, coefficients, 2)
        return float(third @ third) + self.ratio(memory) * float(second @ second)

    def pull(self, coefficients: Array, memory: float) -> Array:
        """The prior's matrix times the coefficients, at stiffness 1.

        By differences: the bands would lose the digits of large angles.
        """
        third = _differences(self.knots, coefficients, 3)
        second = _differences(self.knots, coefficients, 2)
        return _transposed(self.knots, third, _DIFFERENCE) + self.ratio(memory) * _transposed(
            self.knots, second, _SECOND
        )


def _squares(knots: Knots, difference: Array) -> Array:
    """Bands of ``D^T D``."""
    bands = np.zeros((knots.size, BAND))
    width = difference.size
    for first, n in zip(knots.first[:-1], knots.intervals, strict=True):
        rows = n + 4 - width
        for lag in range(width):
            for k, product in enumerate(difference[: width - lag] * difference[lag:]):
                bands[first + k : first + k + rows, lag] += product
    return bands


def _differences(knots: Knots, coefficients: Array, order: int) -> Array:
    parts = np.split(coefficients, knots.first[1:-1])
    return np.concatenate([np.diff(part, order) for part in parts])


def _transposed(knots: Knots, values: Array, difference: Array) -> Array:
    """``D^T`` times differences."""
    out = np.zeros(knots.size)
    at = 0
    for first, n in zip(knots.first[:-1], knots.intervals, strict=True):
        rows = n + 4 - difference.size
        for k, factor in enumerate(difference):
            out[first + k : first + k + rows] += factor * values[at : at + rows]
        at += rows
    return out


def smooth_trends(knots: Knots, counts: Sequence[int]) -> Array:
    """Coefficients of Legendre polynomials of degree 2 on, shape (size, sum of counts).

    Scaled to time in halves of the segment, so that they mean the same motion on every
    grid (but for polynomials of lower degree, which are there too).
    """
    columns = []
    for first, n, count in zip(knots.first[:-1], knots.intervals, counts, strict=True):
        x = (np.arange(n + 3) - 0.5 * (n + 2)) * (2.0 / n)
        for degree in range(2, 2 + count):
            column = np.zeros(knots.size)
            column[first : first + n + 3] = np.polynomial.legendre.Legendre.basis(degree)(x)
            columns.append(column)
    return np.stack(columns, axis=1) if columns else np.zeros((knots.size, 0))


def coarser_rows(parents: NDArray[np.int64], rows: Array) -> Array:
    """``T^T rows``: sums over readings with finer splines turned into those with coarser."""
    padded = np.concatenate([rows, np.zeros((1, *rows.shape[1:]))])
    total: Array = _MASK[0] * padded[parents[:, 0]]
    for k in range(1, 5):
        total += _MASK[k] * padded[parents[:, k]]
    return total


def finer_coefficients(parents: NDArray[np.int64], size: int, coefficients: Array) -> Array:
    """``T c``: the same spline written on the finer grid of ``size`` coefficients."""
    fine = np.zeros(size + 1)
    for k in range(5):
        np.add.at(fine, parents[:, k], _MASK[k] * coefficients)
    return fine[:-1]


def coarser_bands(parents: NDArray[np.int64], bands: Array, coarse: Knots) -> Array:
    """Bands of ``T^T G T``."""
    size = bands.shape[0]
    padded = np.concatenate([bands, np.zeros((1, BAND))])
    stretch = np.repeat(np.arange(len(coarse.intervals)), np.array(coarse.intervals) + 3)
    out = np.zeros((coarse.size, BAND))
    for lag in range(BAND):
        i = parents[: coarse.size - lag, :, None]
        j = parents[lag:, None, :]
        low, gap = np.minimum(i, j), np.abs(i - j)
        known = (gap < BAND) & (np.maximum(i, j) < size)
        values = np.where(known, padded[low, np.minimum(gap, BAND - 1)], 0.0)
        total = np.einsum("k,nkl,l->n", _MASK, values, _MASK)
        same = stretch[: coarse.size - lag] == stretch[lag:]
        out[: coarse.size - lag, lag] = np.where(same, total, 0.0)
    return out


def banded_product(bands: Array, x: Array) -> Array:
    """``G x`` of a symmetric banded matrix."""
    y: Array = bands[:, 0] * x
    for lag in range(1, BAND):
        y[:-lag] += bands[:-lag, lag] * x[lag:]
        y[lag:] += bands[:-lag, lag] * x[:-lag]
    return y


def spline_values(
    coefficients: Array, index: NDArray[np.int64], weights: Sequence[Array] | Array
) -> Array:
    """Spline at the readings whose four coefficients begin at ``index``."""
    total: Array = weights[0] * coefficients[index]
    for k in range(1, 4):
        total += weights[k] * coefficients[index + k]
    return total


class MotionSums(NamedTuple):
    """Normal equations of splines (banded) and common columns, for one target."""

    knots: Knots
    bands: Array
    """``S^T S``, shape (size, 4)."""
    cross: Array
    """``S^T X``, shape (size, m)."""
    spline_right: Array
    """``S^T e``."""
    common: Array
    """``X^T X``."""
    common_right: Array
    """``X^T e``."""
    squares: float
    """``e^T e``."""
    weighty: float
    """Readings of weight."""

    @property
    def bare(self) -> MotionSums:
        """The splines alone, as if the patterns were settled."""
        return self._replace(
            cross=self.cross[:, :0], common=self.common[:0, :0], common_right=self.common_right[:0]
        )


def ordered_motion_sums(
    knots: Knots,
    index: NDArray[np.int64],
    place: Array,
    target: Array,
    weight: Array,
    columns: Callable[[slice, Array], None],
    width: int,
    valid: NDArray[np.bool_] | None = None,
) -> MotionSums:
    """Sums over readings in order of time.

    ``index`` and ``place`` are those of `Knots.place`, the index not decreasing; ``target`` is the
    residual of each reading, ``weight`` the factor of the splines in its row, ``1 + error'``.
    ``columns`` writes the ``width`` common columns of a slice of readings into an array; only
    ``valid`` readings count.
    """
    size, n = knots.size, target.size
    bands, cross = np.zeros((size, BAND)), np.zeros((size, width + 1))
    common = np.zeros((width + 1, width + 1))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(index)) + 1, [n]])
    chunk_edges = np.unique(
        # Readings whose columns are made at once: some MB, so that they stay in cache.
        np.concatenate([edges[np.searchsorted(edges, np.arange(0, n, 4096))], [n]])
    )
    upper = [(p, q) for p in range(4) for q in range(p, 4)]
    for a, b in itertools.pairwise(chunk_edges):
        rows = np.empty((width + 5, b - a))
        columns(slice(a, b), rows[:width])
        rows[width] = target[a:b]
        rows[width + 1 :] = spline_basis(place[a:b]) * weight[a:b]
        if valid is not None:
            rows *= valid[a:b]
        x = rows[: width + 1]
        common += x @ x.T
        splines = rows[width + 1 :]
        inner = edges[np.searchsorted(edges, a) : np.searchsorted(edges, b) + 1] - a
        for i, j in itertools.pairwise(inner):
            first = int(index[a + i])
            block = splines[:, i:j] @ rows[:, i:j].T
            cross[first : first + 4] += block[:, : width + 1]
            square = block[:, width + 1 :]
            for p, q in upper:
                bands[first + p, q - p] += square[p, q]
    return MotionSums(
        knots,
        bands,
        cross[:, :width],
        cross[:, width],
        common[:width, :width],
        common[:width, width],
        float(common[width, width]),
        float(n if valid is None else valid.sum()),
    )
