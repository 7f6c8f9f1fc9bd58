"""Where the curve of a unit is known least: readings spread by what its fleet is like."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..fitting.prior import Prior, fleet_prior
from ..joint.shafts import limited_orders
from ..planning.arc import COVERAGE
from ..planning.plan import check_sizes
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array, first_largest

Places = NDArray[np.int64]

#: Places of the grid to a cycle of the highest order, and at least.
PER_CYCLE, LEAST_PLACES = 48, 361

#: Share of the precision of one reading that a zero and a free coefficient have beforehand: none,
#: to rounding.
FREE = 1e-9

#: Share of the readings by which their number grows, and the most of them.
GROWS, MOST = 0.01, 100_000

#: Passes in which single readings are exchanged for better ones, and readings up to which they are.
PASSES, EXCHANGED = 4, 400


@dataclass(frozen=True, eq=False)
class Spread:
    """What is known of a unit, and the columns of its coefficients over a grid; arcsec.

    ``between`` is by how much runs of one unit differ in a coefficient at most, beyond their noise.
    """

    orders: tuple[float, ...]
    variance: Array
    noise: float
    units: int
    grid: Array
    rows: Array
    between: float

    @classmethod
    def of(
        cls, given: Any, orders: Iterable[float] | None, noise: float | None, a: float, b: float
    ) -> Spread:
        """Of a fleet or its prior, over an arc from turn ``a`` to ``b``."""
        period = getattr(given, "period", 360.0)
        prior: Prior = fleet_prior(given, period)
        arcsec = ARCSEC_PER_TURN / prior.period
        scale = math.sqrt(prior.noise_variance) * arcsec if noise is None else noise
        check_sizes(noise=scale)
        of_order = {
            shaft.cycles_per_turn * order: prior.variance[2 * i : 2 * i + 2] * arcsec**2
            for i, (shaft, order) in enumerate((s, k) for s in prior.shafts for k in s.orders)
        }
        wanted = tuple(of_order) if orders is None else limited_orders(orders)
        wanted = tuple(float(order) for order in wanted)
        if not wanted or len(set(wanted)) < len(wanted) or min(wanted) <= 0.0:
            raise ArgumentError(f"orders must be positive and each named once, got {wanted!r}")
        free = np.full(2, np.inf)
        variance = np.array([of_order.get(order, free) for order in wanted])
        count = max(LEAST_PLACES, math.ceil(PER_CYCLE * max(wanted) * (b - a)) + 1)
        grid = np.linspace(a, b, count)
        x = 2.0 * math.pi * np.outer(grid, wanted)
        lines = np.stack([np.cos(x), np.sin(x)], axis=2).reshape(count, -1)
        rows = np.hstack([np.ones((count, 1)), lines])
        most = 0.0 if prior.run_variance is None else float(prior.run_variance.max())
        between = math.sqrt(most) * arcsec
        return cls(wanted, variance, float(scale), prior.units, grid, rows, between)

    def found(self, readings: int | None, uncertainty: float | None) -> Places:
        """Places of the grid, each reading where the curve is known least, then exchanged."""
        covariance = self.covariance(np.zeros(0, dtype=np.int64))
        places: list[int] = []
        while True:
            if readings is not None and len(places) >= readings:
                break
            variances = self._variances(covariance)
            if (
                uncertainty is not None
                and places
                and COVERAGE**2 * float(variances.max()) <= uncertainty**2
            ):
                break
            if len(places) >= MOST:
                raise ArgumentError(
                    f"`uncertainty={uncertainty:g}` takes more than {MOST} readings of "
                    f"{self.noise:g} arcsec noise: ask for more"
                )
            # Not beyond a per cent at a time: each but shifts where the next belongs.
            for _ in range(max(int(GROWS * len(places)), 1)):
                k = first_largest(variances)
                places.append(k)
                covariance = self._with(covariance, k, 1.0)
                variances = self._variances(covariance)
        found = self._best(np.array(places))
        while uncertainty is not None and found.size > 1:
            fewer = self._best(found[:-1])
            if self.uncertainty(fewer) > uncertainty:
                break
            found = fewer
        return found

    def _best(self, places: Places) -> Places:
        """These readings or even ones, whichever is better once exchanged."""
        last = self.grid.size - 1
        even = (np.linspace(0.0, last, places.size, endpoint=ends) for ends in (True, False))
        starts = (places, *(np.asarray(np.rint(one), dtype=np.int64) for one in even))
        tried = [self._exchanged(one) for one in starts]
        return tried[first_largest(-np.array([self.uncertainty(one) for one in tried]))]

    def uncertainty(self, places: Places) -> float:
        """Expanded, of the curve at the worst place."""
        return COVERAGE * math.sqrt(float(self._variances(self.covariance(places)).max()))

    def covariance(self, places: Places) -> Array:
        """Of the zero and all coefficients, after readings."""
        with np.errstate(divide="ignore"):
            precision = np.concatenate([[0.0], 1.0 / self.variance.ravel()])
        one = 1.0 / self.noise**2
        # A coefficient that all units share is known: so precisely that no reading changes it.
        precision = np.clip(precision, FREE * one, one / FREE)
        rows = self.rows[places]
        return np.asarray(np.linalg.inv(np.diag(precision) + one * (rows.T @ rows)))

    def _exchanged(self, places: Places) -> Places:
        """Each reading moved to where the curve is known least without it, while that gains."""
        if places.size > EXCHANGED:
            return places
        best, reached = places.copy(), self.uncertainty(places)
        for _ in range(PASSES):
            tried = best.copy()
            covariance = self.covariance(tried)
            for i, k in enumerate(tried):
                covariance = self._with(covariance, int(k), -1.0)
                tried[i] = first_largest(self._variances(covariance))
                covariance = self._with(covariance, int(tried[i]), 1.0)
            now = self.uncertainty(tried)
            if now >= reached:
                break
            best, reached = tried, now
        return best

    def _variances(self, covariance: Array) -> Array:
        return np.asarray(np.einsum("ij,ij->i", self.rows @ covariance, self.rows))

    def _with(self, covariance: Array, k: int, sign: float) -> Array:
        """After one reading more at place k, or one less."""
        column = covariance @ self.rows[k]
        taken = float(self.rows[k] @ column) + sign * self.noise**2
        return np.asarray(covariance - np.outer(column, column) / taken)
