"""Where to read over an arc: a joint that cannot turn once."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..errors import ArgumentError
from ..joint.shafts import limited_orders
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.layout import counted
from .doptimal import ArcDesign, OrthonormalColumns, d_optimal, exchanged, rounded
from .noisefactors import noise_factors
from .plan import check_readings, check_sizes, readings_needed
from .result import ArcPlan

#: Readings where neither their number nor what they are for is given.
READINGS = 60

#: Readings of a plan at most: more take minutes to place, and no rig needs them.
MOST = 1_000_000

#: Orders planned for where none are named, as far as the arc resolves them.
USUAL = (1.0, 2.0, 3.0, 4.0)

#: Noise factor from which on an order is not determined: a thousand times the readings of a
#: whole turn.
HOPELESS = math.sqrt(1000.0)

#: Expanded uncertainty of the curve, in its standard deviations.
COVERAGE = 2.0


@told_kinds
def plan_arc(
    start: float,
    stop: float,
    orders: Iterable[float] | None = None,
    *,
    readings: int | None = None,
    runs: int = 1,
    both_directions: bool = False,
    apart: float = 0.0,
    noise: float | None = None,
    standard_error: float | None = None,
    uncertainty: float | None = None,
) -> ArcPlan:
    """D-optimal places for readings of a joint that moves over an arc only.

    The places and shares that make the determinant of the information on the zero and all
    coefficients largest (`trueangle.planning.doptimal`), as whole numbers of readings. By the
    equivalence theorem they also make the largest variance of the curve over the arc smallest:

    ::

        max_x var ε̂(x) = p σ² / N

    with p coefficients (the zero is one) and N readings.

    Parameters
    ----------
    start, stop : float
        Ends of the arc, degrees; at most one turn apart.
    orders : iterable of float, optional
        Output orders wanted; by default 1 to 4, as far as the arc resolves them.
    readings : int, optional
        In all runs together; by default 60, or as many as the wanted error needs.
    runs : int
        Runs of equal design, each with a separate zero.
    both_directions : bool
        Read every place from either side, so that a reversal error is known as well.
    apart : float
        Least distance of two places, degrees: readings at one place are spread by it.
    noise : float, optional
        Scatter of one reading, arcsec.
    standard_error : float, optional
        Wanted standard error of every order's coefficients, arcsec.
    uncertainty : float, optional
        Wanted expanded uncertainty (k = 2) of the curve at every place of the arc, arcsec.

    Returns
    -------
    ArcPlan

    Raises
    ------
    ArgumentError
        An arc of no length or beyond a turn; orders that are collinear over it; too few readings
        for the coefficients or more than a million; a wanted error without ``noise``.

    Notes
    -----
    Efficiency of 60 readings for orders 1 to 4 over 270 deg: 0.997, of even spacing 0.85. Some
    tenths of a second; 2 s for seventeen orders.

    Examples
    --------
    >>> plan = plan_arc(0.0, 180.0, [1], readings=60)
    >>> [round(place, 3) for place in plan.places_deg], plan.counts
    ([0.0, 90.0, 180.0], (20, 20, 20))
    >>> round(plan.d_efficiency, 6), round(plan.efficiency_of_even_spacing, 3)
    (1.0, 0.7)
    """
    check_arc(start, stop)
    check_sizes(noise=noise, standard_error=standard_error, uncertainty=uncertainty)
    wanted = tuple(float(k) for k in limited_orders(USUAL if orders is None else orders))
    if not wanted or len(set(wanted)) < len(wanted) or min(wanted) <= 0.0:
        raise ArgumentError(f"orders must be positive and each named once, got {wanted!r}")
    notes: list[str] = []
    columns, wanted = _columns(wanted, start, stop, orders is None, notes)
    best = d_optimal(columns)
    per_step = runs * (2 if both_directions else 1)
    if runs < 1 or runs != int(runs):
        raise ArgumentError(f"runs must be a whole number of at least 1, got {runs!r}")
    # One more reading than unknowns, so that a fit has a residual.
    least = max(columns.count * per_step, runs + columns.count)
    total = _readings(columns, best, readings, noise, standard_error, uncertainty)
    total = total if readings is not None else max(total, least)
    steps = math.ceil(total / per_step)
    if steps * per_step < least:
        raise ArgumentError(
            f"readings must be at least {least} for {counted(wanted, 'order')}, got {total}"
        )
    while True:
        turns = _spread(_places(columns, best, steps), apart / 360.0, columns)
        even = np.linspace(start, stop, steps) / 360.0
        reached = _uncertainty(columns, turns, per_step, noise)
        if uncertainty is None or reached is None or readings is not None:
            break
        # Share of an uncertainty that rounding may miss it by: as many readings as the optimum
        # needs reach it exactly.
        if reached <= uncertainty * (1.0 + 1e-9):
            break
        # Share of the readings by which their number grows until the uncertainty wanted is reached.
        steps = math.ceil(1.01 * steps)
    factors = noise_factors(turns, wanted)
    beyond = [k for k, f in zip(wanted, factors, strict=True) if f > HOPELESS]
    if beyond:
        notes.append(
            f"order{'s'[: len(beyond) != 1]} {', '.join(f'{k:g}' for k in beyond)}: on this arc "
            "they need more than 1000 times the readings of a whole turn"
        )
    places, counts = np.unique(np.round(turns * 360.0, 6), return_counts=True)
    return ArcPlan(
        start_deg=float(start),
        stop_deg=float(stop),
        orders=wanted,
        places_deg=tuple(places.tolist()),
        counts=tuple(int(n) * (2 if both_directions else 1) for n in counts),
        runs=int(runs),
        both_directions=both_directions,
        d_efficiency=_efficiency(columns, best, turns),
        efficiency_of_even_spacing=_efficiency(columns, best, even),
        noise_factors=dict(zip(wanted, factors.tolist(), strict=True)),
        even_noise_factors=dict(zip(wanted, noise_factors(even, wanted).tolist(), strict=True)),
        uncertainty_arcsec=reached,
        notes=tuple(notes),
    )


def check_arc(start: float, stop: float) -> None:
    """Refuse an arc of no length or beyond a turn."""
    if not (math.isfinite(start) and math.isfinite(stop) and 0.0 < stop - start <= 360.0):
        raise ArgumentError(
            f"an arc runs from `start` to a greater `stop`, at most 360 deg on, got {start!r} to "
            f"{stop!r}"
        )


def _columns(
    wanted: tuple[float, ...], start: float, stop: float, usual: bool, notes: list[str]
) -> tuple[OrthonormalColumns, tuple[float, ...]]:
    """Columns of the orders; of the default ones those that the arc resolves."""
    while True:
        try:
            columns = OrthonormalColumns(wanted, start / 360.0, stop / 360.0)
        except ArgumentError:
            if not usual or len(wanted) == 1:
                raise
        else:
            told = noise_factors(columns.grid, wanted).max() <= HOPELESS
            if told or not usual or len(wanted) == 1:
                break
        wanted = wanted[:-1]
    if usual and len(wanted) < len(USUAL):
        notes.append(
            f"orders up to {wanted[-1]:g}: over {stop - start:g} deg higher ones are "
            "distinguished from them only by a thousand times the readings"
        )
    return columns, wanted


def _readings(
    columns: OrthonormalColumns,
    best: ArcDesign,
    readings: int | None,
    noise: float | None,
    standard_error: float | None,
    uncertainty: float | None,
) -> int:
    """As many as are given, or as the wanted error needs."""
    if readings is not None:
        check_readings(readings, MOST)
        return int(readings)
    if standard_error is None and uncertainty is None:
        return READINGS
    if noise is None:
        raise ArgumentError(
            "how many readings reach a wanted error follows from the scatter of one: give `noise=`"
        )
    needed: list[float] = [columns.count]
    if standard_error is not None:
        dense = np.repeat(best.places, np.maximum(rounded(best.weights, 4096), 1))
        worst = float(noise_factors(dense, columns.orders.tolist()).max())
        needed.append(readings_needed(noise, standard_error, worst))
    if uncertainty is not None:
        ratio = COVERAGE * noise / uncertainty
        needed.append(columns.count * ratio * ratio)
    if max(needed) > MOST:
        raise ArgumentError(
            f"with `noise={noise:g}` more than {MOST} readings are needed; allow a larger error"
        )
    return math.ceil(max(needed))


def _places(columns: OrthonormalColumns, best: ArcDesign, readings: int) -> Array:
    """Places of single readings, the better of the rounded optimum and of exchanges."""
    if best.places.size <= readings:
        found = np.repeat(best.places, rounded(best.weights, readings))
        # Efficiency from which on single readings are not exchanged any more: exchanges gain some
        # thousandths of it, scatter the readings over twice as many places, and leave the worst
        # coefficient up to 7 % more uncertain.
        if _efficiency(columns, best, found) >= 0.985:
            return found
    even = np.linspace(columns.grid[0], columns.grid[-1], readings)
    tried = exchanged(columns, even)
    if best.places.size <= readings and _efficiency(columns, best, found) > _efficiency(
        columns, best, tried
    ):
        return found
    return tried


def _spread(turns: Array, apart: float, columns: OrthonormalColumns) -> Array:
    """Readings that are at least so far apart, as near their places as the arc allows."""
    if not (math.isfinite(apart) and apart >= 0.0):
        raise ArgumentError(f"apart must be a distance in degrees, got {apart * 360.0!r}")
    if apart == 0.0:
        return np.sort(turns)
    start, stop = float(columns.grid[0]), float(columns.grid[-1])
    if (turns.size - 1) * apart > stop - start:
        raise ArgumentError(
            f"{turns.size} places cannot be {apart * 360.0:g} deg apart on "
            f"{(stop - start) * 360.0:g} deg: lower `readings=` or `apart=`"
        )
    ordered = np.sort(turns)
    # Groups around their places, then pushed from either end: distances stay, the order too.
    values, counts = np.unique(ordered, return_counts=True)
    ordered = np.concatenate(
        [v + apart * (np.arange(n) - 0.5 * (n - 1)) for v, n in zip(values, counts, strict=True)]
    )
    index = apart * np.arange(ordered.size)
    ordered = np.maximum.accumulate(np.maximum(ordered, start) - index) + index
    last = stop - index[::-1]
    return np.asarray(np.minimum(ordered, last))


def _efficiency(columns: OrthonormalColumns, best: ArcDesign, turns: Array) -> float:
    shares = np.full(turns.size, 1.0 / turns.size)
    value = (columns.log_det(turns, shares) - best.log_det) / columns.count
    return min(math.exp(value), 1.0)


def _uncertainty(
    columns: OrthonormalColumns, turns: Array, per_step: int, noise: float | None
) -> float | None:
    """Expanded, of the curve at the worst place."""
    if noise is None:
        return None
    shares = np.full(turns.size, 1.0 / turns.size)
    worst = columns.worst_variance(turns, shares)
    return COVERAGE * noise * math.sqrt(worst / (turns.size * per_step))
