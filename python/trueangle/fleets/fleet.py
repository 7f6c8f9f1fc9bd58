"""Looking at a fleet: every unit against the others, and against itself months ago."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..fitting.fit import ROUNDING
from ..fitting.prior import Prior
from ..joint.joint import Joint
from ..joint.shafts import resolve_orders
from ..runs.files import each_runs
from ..support.angles import ARCSEC_PER_TURN, arcsec
from ..support.argumentkinds import told_kinds
from ..support.arrays import median
from ..support.display_units import brief_number
from ..support.suggestions import check_choice
from .history import Change, changes_of
from .outliers import Deviates
from .result import VERDICTS, BetweenOrder, CommonOrder, Fleet, FleetUnit, UnitOrder, Verdict
from .sums import FleetSums
from .tolerance import check_shares, tolerance_of
from .units import FEWEST, SharedPattern, Units, shared_pattern


@told_kinds
def fleet(
    runs: Any,
    by: str = "unit",
    *,
    orders: Iterable[float] | Mapping[str, Iterable[float]] | None = None,
    share: float = 0.95,
    confidence: float = 0.95,
    permitted_arcsec: float | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    **reading: Any,
) -> Fleet:
    """Compare units of one design: outliers, shared pattern, changes since the last time.

    ::

        b_u = μ + d_u,    d_u ~ N(0, T),    b̂_u ~ N(b_u, S_u)

    with ``b̂_u`` each unit's own least squares, T diagonal by order and isotropic in
    cosine and sine, both by restricted maximum likelihood on the units that are no outliers.
    Whether the units share a mean (shafts that are keyed) or none (magnets pressed on at any
    angle) is what predicts held-out units better.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        As `trueangle.read_runs`, with the columns ``unit`` and ``when`` (ISO 8601) where there
        are several dates. Files are summed one after the other and not kept.
    by : {"unit", "run"}
        What identifies the units. Without a column ``unit``, the files or the labels of the runs,
        whichever are more.
    orders : iterable of int, or mapping, optional
        Default: those that the first 32 units together support by evidence, and 1 and 2.
    share, confidence : float
        Of the tolerance limits.
    permitted_arcsec : float, optional
        Error from which a calibration is due: gives the day of the next.
    gear_ratio, fixed_member, shafts
        As in `trueangle.fit`.
    **reading
        ``signals``, ``period``, ``unit_from`` ... of files and tables, as in
        `trueangle.read_runs`.

    Returns
    -------
    Fleet

    Raises
    ------
    ArgumentError
        Runs in different units, no unit whose readings separate the orders, shares that are none.
    FileError
        As `trueangle.read_runs`.

    Notes
    -----
    Sums of ``(2 K)^2`` numbers are kept of each unit and day, K being the orders. Units that
    outlie: 1 % of fleets in which none does. What readings of a run have in common is known where
    units have several runs; else it is counted as a difference between units.

    Examples
    --------
    >>> rng = np.random.default_rng(5)
    >>> x = np.arange(0.0, 360.0, 4.0)
    >>> def unit(name, eccentric):
    ...     a, b = eccentric + rng.normal(0.0, 0.01, 2)
    ...     error = a * np.cos(np.radians(x)) + b * np.sin(np.radians(x))
    ...     noise = rng.normal(0.0, 0.001, x.size)
    ...     return ta.CalibrationRun(x, x + error + noise, 360.0, unit=name)
    >>> import trueangle as ta
    >>> found = ta.fleet([unit(f"SN{i}", 0.2 * (i == 7)) for i in range(12)], orders=[1, 2])
    >>> found.units[0].unit, found.units[0].verdict
    ('SN7', 'outlier')
    """
    check_choice("by", by, ("unit", "run"))
    check_shares(share, confidence)
    if permitted_arcsec is not None and not 0.0 < permitted_arcsec < math.inf:
        raise ArgumentError(f"permitted_arcsec must be positive, got {permitted_arcsec!r}")
    wanted = None if orders is None else resolve_orders(orders, gear_ratio, fixed_member, shafts)
    if wanted is not None and not wanted:
        raise ArgumentError("orders is empty: name one at least")
    sums = FleetSums(by, wanted, (gear_ratio, fixed_member, shafts))
    each_runs(runs, reading, sums.add)
    dated, untold = sums.calibrations()
    if not dated:
        raise ArgumentError(
            f"orders: no unit has readings that separate all {sums.orders.size} of them; "
            "name fewer, or read more places"
        )
    notes = []
    if by == "unit" and not sums.named:
        kind = "file (its name without folders)" if sums.by_file else "run"
        notes.append(
            f"No column names the units: every {kind} is treated as a unit. Name units by the role "
            "'unit' or by a pattern of the names (`unit_from=`)."
        )
    if untold:
        notes.append(f"The readings of {_listed(untold)} do not separate the orders; omitted.")
    found = Units(dated, sums.shafts or [], sums.period or 1.0)
    joint = Joint(gear_ratio or 1.0, fixed_member if gear_ratio else "none")
    turn = found.period / ARCSEC_PER_TURN
    permitted = None if permitted_arcsec is None else permitted_arcsec * turn
    return _judged_fleet(found, joint, share, confidence, permitted, notes)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"{', '.join(names[:5])}{more}"


def _judged_fleet(
    units: Units,
    joint: Joint,
    share: float,
    confidence: float,
    permitted: float | None,
    notes: list[str],
) -> Fleet:
    """Verdicts, and what the fleet is like."""
    n = len(units.last)
    chosen = shared_pattern(units)
    if n < FEWEST:
        those = "One unit is" if n == 1 else f"{n} units are"
        notes.append(f"{those} too few for outliers or a common pattern: {FEWEST} are needed.")
    again = [dates for dates in units.dated if len(dates) > 1]
    spread = np.array([one.variance for one in chosen.between])
    changes = {
        change.unit: change
        for change in changes_of(again, units.orders, units.period, spread, permitted)
    }
    if again and not changes:
        notes.append(
            f"{len(again)} units calibrated again are too few to estimate an ordinary change: "
            "4 are needed."
        )
    belong = chosen.belong
    sizes = np.maximum(units.peak_to_peak, ROUNDING * units.period)[belong]
    bound = tolerance_of(sizes, np.exp(units.log_left[belong, 0]), share, confidence)
    if not belong.all():
        notes.append(
            f"Common pattern, spread and tolerance limits are those of the {int(belong.sum())} "
            "units that are no outliers."
        )
    elif chosen.deviates.outlying.any():
        notes.append(
            f"{int(chosen.deviates.outlying.sum())} of {n} units are outliers: so many are rather "
            "of another design than damaged. The spread and the limits include them."
        )
    names = [(shaft.name, k) for shaft in units.shafts for k in shaft.orders]
    repeats = _repeatability(units)
    rows = zip(units.orders.tolist(), names, chosen.between, strict=True)
    ranked = sorted(
        (_unit_row(units, u, chosen.deviates, changes, joint) for u in range(n)),
        key=lambda unit: (VERDICTS.index(unit.verdict), unit.p),
    )
    return Fleet(
        tuple(ranked),
        tuple(
            CommonOrder(
                order,
                shaft,
                *_polar(*one.mean.tolist()),
                math.sqrt(float(np.trace(one.covariance)) / 2.0),
            )
            for order, (shaft, _), one in rows
        ),
        tuple(
            BetweenOrder(order, math.sqrt(one.variance), again)
            for order, one, again in zip(
                units.orders.tolist(), chosen.between, repeats, strict=True
            )
        ),
        bound,
        tuple(row for change in changes.values() for row in change.rows),
        chosen.probability,
        _prior(units, chosen),
        tuple(notes),
    )


def _polar(cosine: float, sine: float) -> tuple[float, float]:
    """Amplitude, and phase in [0, 360) degrees."""
    return math.hypot(cosine, sine), math.degrees(math.atan2(cosine, sine)) % 360.0


def _prior(units: Units, chosen: SharedPattern) -> Prior:
    """The predictive distribution of a further unit."""
    kept = int(chosen.belong.sum())
    mean = np.concatenate([one.mean for one in chosen.between])
    variance = np.concatenate(
        [np.full(2, one.variance) + np.diag(one.covariance) for one in chosen.between]
    )
    return Prior(
        units.period,
        tuple(units.shafts),
        mean,
        variance,
        max(2.0 * (kept - float(chosen.probability > 0.5)), 1.0),
        max(units.noise.variance, 1e-30 * units.period**2),
        units.noise.freedom,
        kept,
        units.run_variance,
    )


def _repeatability(units: Units) -> list[float | None]:
    """Standard deviation of one run's coefficients about its unit's, by order."""
    freedom = sum(one.repeat_freedom for dates in units.dated for one, _ in dates)
    if not freedom:
        return [None] * units.orders.size
    squares = np.sum([one.repeat_squares for dates in units.dated for one, _ in dates], axis=0)
    return [math.sqrt(float(square) / freedom) for square in squares]


def _unit_row(
    units: Units, u: int, found: Deviates, changes: Mapping[str, Change], joint: Joint
) -> FleetUnit:
    """One unit's row."""
    calibration, noise = units.last[u]
    pairs = calibration.coefficients.reshape(-1, 2)
    stds = np.sqrt(noise * np.einsum("kii->k", calibration.blocks()) / 2.0)
    change = changes.get(calibration.unit)
    outlying = bool(found.outlying[u])
    verdict: Verdict = "fine"
    p, limit, because = float(found.unit[u]), found.limit, ""
    if change is not None and (change.moved or change.zero_moved):
        p, limit = change.chance, change.level
        verdict, because = _moved(units, u, change, joint)
    elif outlying:
        verdict, because = "outlier", _outlying(units, u, found, joint)
    elif p <= limit:
        because = _among_tails(len(units.last))
    return FleetUnit(
        calibration.unit,
        verdict,
        because,
        tuple(
            UnitOrder(order, *_polar(a, b), float(std), float(z))
            for order, (a, b), std, z in zip(
                units.orders.tolist(), pairs.tolist(), stds, found.size[u, :-1], strict=True
            )
        ),
        float(units.peak_to_peak[u]),
        float(units.left[u]),
        p,
        limit,
    )


def _among_tails(count: int) -> str:
    """Why a unit that is far from the others is no outlier."""
    if count < FEWEST:
        return f"far from the others, but {FEWEST} units are needed to find an outlier"
    return (
        "far from the others, but a quarter of the units deviate as much: probably "
        "several designs, not damage"
    )


def _outlying(units: Units, u: int, found: Deviates, joint: Joint) -> str:
    """Which orders, and what they are likely to be; and by how much the residual differs."""
    outside, orders, told = found.outside(u), units.orders.tolist(), []
    if places := [k for k in outside if k < len(orders)]:
        first, *others = (f"order {orders[k]:g} is {found.size[u, k]:.1f}" for k in places[:3])
        sizes = ", ".join([f"{first} standard deviations from the others", *others])
        whose = f"; order {orders[places[0]]:g}" if others else ""
        told = [f"{sizes}{whose}: {joint.explanations(orders[places[0]])[0]}"]
    if len(places) < len(outside):
        left = arcsec(1.0, units.period) * np.exp(units.log_left[:, 0])
        told.append(
            f"residual of {left[u]:.3g} arcsec is {brief_number(left[u] / median(left))} times the "
            "fleet's median: its noise, slip or drift differs; diagnose its runs"
        )
    return "; ".join(told)


def _moved(units: Units, u: int, change: Change, joint: Joint) -> tuple[Verdict, str]:
    """The verdict of a unit that is not what it was."""
    scale = arcsec(1.0, units.period)
    first, last = units.dated[u][0][0].when, units.dated[u][-1][0].when
    since = f"from {first} to {last}"
    if not change.moved:
        return "zero_moved", f"the zero moved by {scale * change.zero:.4g} arcsec {since}"
    twin = _twin(units, u, change)
    if twin is not None:
        return "changed", f"its pattern is now that of {twin} before: are the labels exchanged?"
    pairs = np.hypot(*change.pattern.reshape(-1, 2).T)
    told = ", ".join(
        f"order {units.orders[k]:g} by {scale * pairs[k]:.3g} arcsec" for k in change.orders[:3]
    )
    told = f"moved {since}: {told}{' and the zero' if change.zero_moved else ''}"
    cause = joint.explanations(float(units.orders[change.orders[0]]))[0]
    if change.grows is False:
        return "changed", f"{told}, in a step: {cause}"
    if change.grows is None and change.leaps:
        return "changed", f"{told}, more than units differ by: {cause}"
    if change.grows is None and 2 * len(change.orders) > max(units.orders.size, 2):
        return "changed", f"{told}, all together: was a part replaced or turned?"
    slow = "it grows slowly" if change.grows else "two dates cannot separate a drift from a step"
    return "recalibrate", f"{told}; {slow}"


def _twin(units: Units, u: int, change: Change) -> str | None:
    """Another unit whose first pattern is this one's last, as near as ordinary changes are."""
    now = units.coefficients[u]
    limit = np.repeat(np.hypot(*change.pattern.reshape(-1, 2).T), 2)
    moved = float(limit @ limit) / 2.0
    best, name = 0.05 * moved, None
    for v, dates in enumerate(units.dated):
        apart = dates[0][0].coefficients - now
        if v != u and float(apart @ apart) < best:
            best, name = float(apart @ apart), dates[0][0].unit
    return name
