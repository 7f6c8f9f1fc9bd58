"""How few readings are enough for one more unit of a fleet, and where its curve is known least."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..estimation.linear import pseudo_inverse
from ..fitting.prior import Prior, fleet_prior
from ..joint.shafts import limited_orders
from ..planning.arc import COVERAGE, check_arc, plan_arc
from ..planning.plan import check_readings, check_sizes
from ..planning.result import place_table, plain_arc_plan
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array, first_largest
from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult

_Places = NDArray[np.int64]

#: Places of the grid to a cycle of the highest order, and at least.
_PER_CYCLE, _LEAST_PLACES = 48, 361

#: Share of the precision of one reading that a zero and a free coefficient have beforehand: none,
#: to rounding.
_FREE = 1e-9

#: Share of the readings by which their number grows, and the most of them.
_GROWS, _MOST = 0.01, 100_000

#: Passes in which single readings are exchanged for better ones, and readings up to which they are.
_PASSES, _EXCHANGED = 4, 400


@dataclass(frozen=True)
class UnitPlan(PlainResult):
    """Readings of a unit whose coefficients are distributed as those of its fleet.

    Attributes
    ----------
    start_deg, stop_deg : float
    orders : tuple of float
        Output orders, fitted together with the zero.
    places_deg : tuple of float
        Increasing.
    counts : tuple of int
        Readings at each place.
    noise_arcsec : float
        Of one reading.
    uncertainty_arcsec : float
        Expanded uncertainty (k = 2) of the curve, with its zero, at the worst place of the arc,
        over units that are like those of the fleet.
    std_arcsec : dict of order to float
        Standard error of a coefficient of each order, likewise.
    own : dict of order to float
        Share of each order's spread between units that the readings take away.
    readings_without : int or None
        Readings needed for the same uncertainty without the fleet; None if no number of them
        determines the orders on this arc.
    units : int
        From which the prior is known.
    notes : tuple of str
    """

    start_deg: float
    stop_deg: float
    orders: tuple[float, ...]
    places_deg: tuple[float, ...]
    counts: tuple[int, ...]
    noise_arcsec: float
    uncertainty_arcsec: float
    std_arcsec: dict[float, float]
    own: dict[float, float]
    readings_without: int | None
    units: int
    notes: tuple[str, ...] = ()

    @property
    def readings(self) -> int:
        """All of them."""
        return sum(self.counts)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON for a unit of a fleet."""
        return plain_arc_plan(self, "unit")

    def summary(self) -> str:
        """The plan as text: a table to follow at the rig."""
        without = self.readings_without
        lines = [
            f"{self.readings} readings over {self.start_deg:g} to {self.stop_deg:g} deg, of a unit "
            f"like the {self.units} of the fleet"
            + (f" ({without} without it)" if without is not None else ""),
            *place_table(self.places_deg, self.counts),
            f"  uncertainty (k = 2)    {self.uncertainty_arcsec:.3g} arcsec at the worst place",
            f"  noise of a reading     {self.noise_arcsec:.3g} arcsec",
            "  order  std/arcsec  the unit's own",
        ]
        for order, std in self.std_arcsec.items():
            lines.append(f"  {order:5g}  {std:10.3g}  {100.0 * self.own[order]:13.0f}%")
        lines += [f"  note: {note}" for note in self.notes]
        return laid_out(lines)

    def _brief(self) -> str:
        without = "" if self.readings_without is None else f" ({self.readings_without} without)"
        return (
            f"{self.readings} readings{without} at {counted(self.places_deg, 'place')}, "
            f"{self.uncertainty_arcsec:.3g} arcsec at the worst"
        )


@told_kinds
def plan_unit(
    prior: Any,
    start: float = 0.0,
    stop: float = 360.0,
    orders: Iterable[float] | None = None,
    *,
    uncertainty: float | None = None,
    readings: int | None = None,
    noise: float | None = None,
) -> UnitPlan:
    """The fewest readings of a further unit of a fleet that reach an uncertainty, and where.

    The coefficients of such a unit are ``N(μ, T)``; after readings X of noise s they scatter
    by

    ::

        C = (Xᵀ X / s² + T⁻¹)⁻¹

    and each further reading is taken where the curve is known least, ``f(x)ᵀ C f(x)``, which
    adds most to ``det C⁻¹``. Single readings are then exchanged while that gains.

    Parameters
    ----------
    prior : Fleet
        Or the `trueangle.fitting.prior.Prior` of one.
    start, stop : float
        Ends of the arc, degrees; a whole turn by default.
    orders : iterable of float, optional
        Output orders to fit, by default those of the fleet. One that the fleet does not know is
        free.
    uncertainty : float, optional
        Wanted expanded uncertainty (k = 2) of the curve at every place, arcsec.
    readings : int, optional
        Readings to spend, in place of that.
    noise : float, optional
        Standard deviation of one reading, arcsec; that of the fleet's by default.

    Returns
    -------
    UnitPlan

    Raises
    ------
    ArgumentError
        Neither or both of ``uncertainty`` and ``readings``; an arc of no length or beyond a turn; a
        number out of range; an uncertainty that takes more than a hundred thousand readings.
    KindError
        No fleet.

    Notes
    -----
    Of `trueangle.fit` with the same ``prior``. The promise is one about units like those of the
    fleet, on average: a unit that is damaged is none.
    Source: Chaloner and Verdinelli (1995), Bayesian experimental design: a review.

    Examples
    --------
    >>> import numpy as np
    >>> from trueangle.fitting.prior import Prior
    >>> from trueangle.joint.shafts import ShaftOrders
    >>> known = Prior(  # order 1 scatters by 10 arcsec from unit to unit, order 2 by 1 arcsec
    ...     360.0, (ShaftOrders("output", 1.0, (1, 2)),), np.zeros(4),
    ...     (np.array([10.0, 10.0, 1.0, 1.0]) / 3600.0) ** 2, 60.0, (3.0 / 3600.0) ** 2, 600.0, 40,
    ... )
    >>> plan = plan_unit(known, uncertainty=4.0)
    >>> plan.readings < plan.readings_without
    True
    """
    check_arc(start, stop)
    if (uncertainty is None) == (readings is None):
        raise ArgumentError(
            "give either `uncertainty=` (how few readings are enough) or `readings=` (what they "
            "are enough for)"
        )
    known = Spread.of(prior, orders, noise, start / 360.0, stop / 360.0)
    check_sizes(uncertainty=uncertainty)
    check_readings(readings, _MOST)
    places = known.found(readings, uncertainty)
    reached = known.uncertainty(places)
    without = _without(start, stop, known, reached)
    notes = []
    if without is not None and without <= places.size:
        notes.append("the fleet spares no readings here: its units differ by more than is wanted")
    if known.between > 0.0:
        notes.append(
            f"runs of one unit of this fleet differ by {known.between:.3g} arcsec in a coefficient "
            "beyond their noise; more readings of one run do not improve on this"
        )
    turns, counts = np.unique(np.round(known.grid[places] * 360.0, 6), return_counts=True)
    left = np.diag(known.covariance(places))[1:].reshape(-1, 2)
    taken = np.divide(left, known.variance, out=np.ones_like(left), where=known.variance > 0.0)
    return UnitPlan(
        float(start),
        float(stop),
        known.orders,
        tuple(turns.tolist()),
        tuple(int(n) for n in counts),
        known.noise,
        reached,
        dict(zip(known.orders, np.sqrt(left.mean(axis=1)).tolist(), strict=True)),
        dict(zip(known.orders, np.clip(1.0 - taken, 0.0, 1.0).mean(axis=1).tolist(), strict=True)),
        without,
        known.units,
        tuple(notes),
    )


def _without(start: float, stop: float, known: Spread, uncertainty: float) -> int | None:
    """Readings needed for the same uncertainty if nothing is known about the unit."""
    try:
        plan = plan_arc(start, stop, known.orders, noise=known.noise, uncertainty=uncertainty)
    except ArgumentError:
        return None
    return plan.readings


@dataclass(frozen=True, eq=False)
class Spread:
    """What is known about a unit, and the columns of its coefficients over a grid; arcsec.

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
        wanted = tuple(map(float, of_order if orders is None else limited_orders(orders)))
        if not wanted or len(set(wanted)) < len(wanted) or min(wanted) <= 0.0:
            raise ArgumentError(f"orders must be positive and each named once, got {wanted!r}")
        free = np.full(2, np.inf)
        variance = np.array([of_order.get(order, free) for order in wanted])
        count = max(_LEAST_PLACES, math.ceil(_PER_CYCLE * max(wanted) * (b - a)) + 1)
        grid = np.linspace(a, b, count)
        x = 2.0 * math.pi * np.outer(grid, wanted)
        lines = np.stack([np.cos(x), np.sin(x)], axis=2).reshape(count, -1)
        rows = np.hstack([np.ones((count, 1)), lines])
        runs = 0.0 if prior.run_variance is None else float(prior.run_variance.max())
        return cls(
            wanted, variance, float(scale), prior.units, grid, rows, math.sqrt(runs) * arcsec
        )

    def found(self, readings: int | None, uncertainty: float | None) -> _Places:
        """Places of the grid, each reading where the curve is known least, then exchanged."""
        covariance = self.covariance(np.zeros(0, dtype=np.int64))
        places: list[int] = []
        while readings is None or len(places) < readings:
            variances = self._variances(covariance)
            reached = COVERAGE * math.sqrt(float(variances.max()))
            if uncertainty is not None and places and reached <= uncertainty:
                break
            if len(places) >= _MOST:
                raise ArgumentError(
                    f"`uncertainty={uncertainty:g}` takes more than {_MOST} readings of "
                    f"{self.noise:g} arcsec noise: allow a larger one"
                )
            # Not beyond a per cent at a time: each but shifts where the next belongs.
            for _ in range(max(int(_GROWS * len(places)), 1)):
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

    def _best(self, places: _Places) -> _Places:
        """These readings or even ones, whichever is better once exchanged."""
        last = self.grid.size - 1
        even = (np.linspace(0.0, last, places.size, endpoint=ends) for ends in (True, False))
        starts = (places, *(np.asarray(np.rint(one), dtype=np.int64) for one in even))
        tried = [self._exchanged(one) for one in starts]
        return tried[first_largest(-np.array([self.uncertainty(one) for one in tried]))]

    def uncertainty(self, places: _Places) -> float:
        """Expanded, of the curve at the worst place."""
        return COVERAGE * math.sqrt(float(self._variances(self.covariance(places)).max()))

    def covariance(self, places: _Places) -> Array:
        """Of the zero and all coefficients, after readings."""
        with np.errstate(divide="ignore"):
            precision = np.concatenate([[0.0], 1.0 / self.variance.ravel()])
        one = 1.0 / self.noise**2
        # A coefficient that all units share is known: so precisely that no reading changes it.
        precision = np.clip(precision, _FREE * one, one / _FREE)
        rows = self.rows[places]
        return pseudo_inverse(np.diag(precision) + one * (rows.T @ rows))

    def _exchanged(self, places: _Places) -> _Places:
        """Each reading moved to where the curve is known least without it, while that gains."""
        if places.size > _EXCHANGED:
            return places
        best, reached = places.copy(), self.uncertainty(places)
        for _ in range(_PASSES):
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
