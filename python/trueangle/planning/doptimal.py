"""D-optimal designs of Fourier series over an arc, and their whole readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..estimation.linear import least_squares, pseudo_inverse
from ..support.arrays import Array, first_largest

#: Multiplicative steps on the grid, and the excess that ends them: a design's efficiency is at
#: least 1 / (1 + excess).
_GRID_EXCESS = 1e-4


#: Share of the largest singular value of the columns below which an arc does not resolve them:
#: the variance grows with the square of its inverse.
_SINGULAR = 1e-7


@dataclass(frozen=True)
class ArcDesign:
    """Places and weights over an arc, in turns.

    Attributes
    ----------
    places, weights : ndarray, shape (s,)
        Increasing places and the shares of the readings that belong there.
    excess : float
        ``max_x d(x) / p - 1`` over the arc, d the variance of the fitted curve times the
        number of readings and p the number of coefficients: 0 for the optimum (Kiefer and
        Wolfowitz).
    log_det : float
        ``ln det M`` of the design, with plain cosine and sine columns.
    """

    places: Array
    weights: Array
    excess: float
    log_det: float


class OrthonormalColumns:
    """The constant and both parts of every order, made orthonormal over the arc.

    D-optimality does not depend on the basis; an arc's own keeps rounding small.
    """

    def __init__(self, orders: Sequence[float], start: float, stop: float) -> None:
        self.orders = np.asarray(orders, dtype=np.float64)
        # Places to a cycle of the highest order, and at least.
        count = math.ceil(48 * float(self.orders.max()) * (stop - start))
        self.grid = np.linspace(start, stop, max(801, count + 1))
        self._turned: Array | None = None
        raw = self.at(self.grid)
        _, values, turned = np.linalg.svd(raw, full_matrices=False)
        if values[-1] < _SINGULAR * values[0]:
            raise ArgumentError(
                f"orders {', '.join(f'{k:g}' for k in orders)} look the same over "
                f"{(stop - start) * 360.0:g} deg: use fewer orders (`orders=`), or a longer arc"
            )
        self._turned = turned.T * (math.sqrt(self.grid.size) / values)
        self.log_scale = 2.0 * float(np.sum(np.log(values / math.sqrt(self.grid.size))))

    @property
    def count(self) -> int:
        """Coefficients, the constant among them."""
        return 1 + 2 * int(self.orders.size)

    def at(self, places: Array) -> Array:
        """Rows of the design at places in turns."""
        x = 2.0 * math.pi * np.outer(places, self.orders)
        raw = np.hstack([np.ones((len(places), 1)), np.cos(x), np.sin(x)])
        return raw if self._turned is None else np.asarray(raw @ self._turned)

    def slopes(self, places: Array) -> tuple[Array, Array]:
        """First and second derivative of the rows by the place."""
        x, w = 2.0 * math.pi * np.outer(places, self.orders), 2.0 * math.pi * self.orders
        none = np.zeros((len(places), 1))
        first = np.hstack([none, -w * np.sin(x), w * np.cos(x)])
        second = np.hstack([none, -(w**2) * np.cos(x), -(w**2) * np.sin(x)])
        return (
            (first, second)
            if self._turned is None
            else (first @ self._turned, second @ self._turned)
        )

    def information(self, places: Array, weights: Array) -> Array:
        """Information matrix of one reading, shared out by the weights."""
        rows = self.at(places)
        return np.asarray(rows.T @ (weights[:, None] * rows))

    def log_det(self, places: Array, weights: Array) -> float:
        """``ln det M`` with plain cosine and sine columns; minus infinity where it is singular."""
        sign, value = np.linalg.slogdet(self.information(places, weights))
        return float(value) + self.log_scale if sign > 0 else -math.inf

    def worst_variance(self, places: Array, weights: Array) -> float:
        """Of the curve over the arc, for one reading of variance 1 shared out by the weights."""
        covariance = pseudo_inverse(self.information(places, weights))
        return float(_variances(self.at(self.grid), covariance).max())


def d_optimal(columns: OrthonormalColumns) -> ArcDesign:
    """The design whose information has the largest determinant.

    ::

        max_ξ det ∫ f(x) f(x)ᵀ ξ(dx),    f = (1, cos k x, sin k x ...)

    by multiplicative steps on a grid (Titterington 1976). Where as many places as coefficients
    are left, each belongs to an equal share, and they are moved off the grid one by one until the
    equivalence theorem holds to rounding.

    Examples
    --------
    >>> found = d_optimal(OrthonormalColumns([1], 0.0, 0.5))
    >>> (360.0 * found.places).round(3).tolist(), found.weights.round(6).tolist()
    ([0.0, 90.0, 180.0], [0.333333, 0.333333, 0.333333])
    """
    grid, p = columns.grid, columns.count
    rows = columns.at(grid)
    weights = np.full(grid.size, 1.0 / grid.size)
    excess = math.inf
    # Multiplicative steps on the grid; the excess ends them: a design's efficiency is at least 1 /
    # (1 + excess).
    for _ in range(2000):
        variances = _variances(rows, pseudo_inverse(rows.T @ (weights[:, None] * rows)))
        excess = float(variances.max()) / p - 1.0
        if excess < _GRID_EXCESS:
            break
        weights *= variances / p
    places, shares = _merged(grid, weights, p)
    # Even places may be such that two orders are the same numbers there: no start for a search.
    if places.size == p and np.linalg.cond(columns.at(places)) * _SINGULAR < 1.0:
        places, shares, settled = _settled(columns, places)
        if settled < max(excess, _GRID_EXCESS):
            return ArcDesign(places, shares, settled, columns.log_det(places, shares))
    heavy = weights > 1e-3 / grid.size
    places, shares = grid[heavy], weights[heavy] / weights[heavy].sum()
    return ArcDesign(places, shares, excess, columns.log_det(places, shares))


def _variances(rows: Array, covariance: Array) -> Array:
    """Variance of the curve at every row."""
    return np.asarray(np.einsum("ij,ij->i", rows @ covariance, rows))


def _merged(grid: Array, weights: Array, least: int) -> tuple[Array, Array]:
    """Groups of neighbouring places as one each; evenly spread weight as even places."""
    heavy = np.flatnonzero(weights > 1e-2 * weights.max())
    groups = np.split(heavy, np.flatnonzero(np.diff(heavy) > 1) + 1)
    if len(groups) < least:
        # The weight is spread: even places that hold as many coefficients serve as well.
        step = min(1.0 / least, (grid[-1] - grid[0]) / (least - 1))
        return grid[0] + step * np.arange(least), np.full(least, 1.0 / least)
    places = np.array([np.average(grid[g], weights=weights[g]) for g in groups])
    shares = np.array([weights[g].sum() for g in groups])
    return places, shares / shares.sum()


def _settled(columns: OrthonormalColumns, places: Array) -> tuple[Array, Array, float]:
    """As many places as coefficients, each optimal given the others; their excess.

    By Newton's method for all places together, by a sweep over them where that loses.
    """
    shares = np.full(places.size, 1.0 / places.size)
    # Until no place moves so far (turns) any more.
    for _ in range(400):
        tried = _newton(columns, places)
        # Less of a logarithm is lost in rounding.
        if columns.log_det(tried, shares) < columns.log_det(places, shares) - 1e-10:
            tried = _swept(columns, places)
        moved = float(np.abs(tried - places).max())
        places = tried
        if moved < 1e-9:
            break
    return places, shares, columns.worst_variance(places, shares) / columns.count - 1.0


def _swept(columns: OrthonormalColumns, places: Array) -> Array:
    """Every place in turn moved to its best between its neighbours."""
    places = places.copy()
    for k in range(places.size):
        # The determinant is that of the other rows times the distance of this row from them.
        normal = least_squares(columns.at(places), np.eye(places.size)[k])

        def apart(x: Array, normal: Array = normal) -> Array:
            return np.asarray(np.abs(columns.at(x) @ normal))

        below = places[k - 1] if k else columns.grid[0]
        above = places[k + 1] if k + 1 < places.size else columns.grid[-1]
        places[k] = _highest(apart, float(below), float(above))
    return places


def _newton(columns: OrthonormalColumns, places: Array) -> Array:
    """A step of Newton's method on ``ln|det F|``, F the rows at the places.

    Its slope is the diagonal of ``A = F' F⁻¹``, its curvature
    ``(F'' F⁻¹)_ii - A_ii²`` and ``-A_ij A_ji``. Ends of the arc stay.
    """
    start, stop = float(columns.grid[0]), float(columns.grid[-1])
    inverse = least_squares(columns.at(places), np.eye(places.size))
    first, second = (slope @ inverse for slope in columns.slopes(places))
    inner = (places > start) & (places < stop)
    curvature = -(first * first.T)
    curvature[np.diag_indices(places.size)] += np.diag(second)
    # A turn of all places together may change nothing.
    step = least_squares(curvature[np.ix_(inner, inner)], np.diag(first)[inner])
    found = places.copy()
    found[inner] -= step
    inside = found.min() >= start and found.max() <= stop and np.diff(found).min() > 0.0
    return found if inside else _swept(columns, places)


def _highest(height: Callable[[Array], Array], low: float, high: float) -> float:
    """Where a function of one peak between two places is highest, by ever finer looks."""
    for _ in range(9):
        x = np.linspace(low, high, 33)
        k = int(np.argmax(height(x)))
        low, high = float(x[max(k - 1, 0)]), float(x[min(k + 1, 32)])
        best = float(x[k])
    return best


def exchanged(columns: OrthonormalColumns, places: Array) -> Array:
    """Places of single readings, each exchanged for a better one of the grid while one is.

    Fedorov's exchange: taking reading i out and x in multiplies the determinant by
    ``(1 + d_xx)(1 - d_ii) + d_ix²``.
    """
    grid = columns.at(columns.grid)
    places = places.copy()
    for _ in range(20):
        before = columns.log_det(places, np.ones(places.size))
        for i in range(places.size):
            rows = columns.at(places)
            inverse = pseudo_inverse(rows.T @ rows)
            mixed = grid @ (inverse @ rows[i])
            own = float(rows[i] @ inverse @ rows[i])
            gains = (1.0 + _variances(grid, inverse)) * (1.0 - own) + mixed**2
            k = first_largest(gains)
            if gains[k] > 1.0 + 1e-9:
                places[i] = columns.grid[k]
        if columns.log_det(places, np.ones(places.size)) < before + 1e-4:
            break
    return np.sort(places)


def rounded(weights: Array, readings: int) -> NDArray[np.int64]:
    """Whole numbers of readings that lose the least (Pukelsheim and Rieder 1992).

    Examples
    --------
    >>> rounded(np.array([0.5, 0.3, 0.2]), 7).tolist()
    [3, 2, 2]
    """
    counts = np.ceil((readings - 0.5 * weights.size) * weights).astype(np.int64)
    while counts.sum() < readings:
        counts[np.argmin(counts / weights)] += 1
    while counts.sum() > readings:
        counts[np.argmax((counts - 1) / weights)] -= 1
    return np.asarray(counts)
