"""Units calibrated again: what changed, whether by a step or drift, and when the next is due."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Final, NamedTuple

import numpy as np

from ..estimation.linear import wald_statistic
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.decoding import parsed_time
from ..support.distributions import f_quantile
from ..support.plainresult import Angle
from ..support.runlength import chart_limit
from .calibration import Calibration, order_columns
from .outliers import LEVEL, Deviates, deviates, level_by_order

#: Half of the shift that is looked for, in standard deviations of a calibration.
_ALLOWANCE: Final = 0.5


class HistoryOrder(NamedTuple):
    """One order on one date: T^2 against the first date, and the larger cumulative sum."""

    order: float
    statistic: float
    cusum: float


class HistoryRow(NamedTuple):
    """Result of one further calibration of a unit.

    ``order`` is the order that moved most (None: the zero); ``statistic`` its T^2 and ``limit``
    what it stays below in 99 % of fleets in which nothing moved. ``bound`` is that of 95 % of the
    greatest change over a turn since the first date, in the unit of the period; the day at which
    it reaches the permitted error, growing linearly in time, is ``next_calibration``. ``orders``
    has the charts of all orders (`charted`), which pass ``cusum_limit`` once in
    465 dates where nothing moves, those of a unit together.
    """

    unit: str
    when: str
    order: float | None
    statistic: float
    limit: float
    verdict: str
    next_calibration: str | None
    extrapolated: bool
    bound: Angle | None
    cusum_limit: float
    orders: tuple[HistoryOrder, ...]


class Change(NamedTuple):
    """A unit's last calibration against its first.

    ``orders`` are places of the orders that moved, the first the most; ``grows`` whether a slow
    drift explains the dates between better than a step (None with two dates); ``leaps`` whether
    it moved farther than two units of the fleet are apart, in 99 % of fleets. ``level`` is the
    probability at or below which it is reported.
    """

    unit: str
    moved: bool
    zero_moved: bool
    orders: tuple[int, ...]
    chance: float
    level: float
    zero: float
    pattern: Array
    std: Array
    grows: bool | None
    leaps: bool
    rows: tuple[HistoryRow, ...]


def changes_of(
    dated: Sequence[Sequence[tuple[Calibration, float]]],
    orders: Array,
    period: float,
    between: Array,
    permitted: float | None,
) -> list[Change]:
    """Every unit's last calibration against its first.

    ::

        T² = (b_t - b₀)' (W + S_t + S₀)⁻¹ (b_t - b₀)

    per order, with W the variance of an ordinary change, by the median over the fleet itself; the
    zero apart, for ordinary remounting moves it. Extreme deviates as among units
    (`trueangle.fleets.outliers`), at half of 1 % each.

    Parameters
    ----------
    dated : sequence of sequences
        Of every unit: its calibrations in the order of their dates, with the variance of a reading.
    orders : ndarray
    period : float
    between : ndarray, shape (K,)
        Variance between units of each order.
    permitted : float or None
        Error from which a calibration is due.
    """
    # Fewest units with a second date whose changes define an ordinary change.
    if len(dated) < 4:
        return []
    values, own, zeros, zero_own = _differences(dated, period)
    pattern = deviates(values, own, False, 0.5 * LEVEL, level_by_order(orders))
    # The zero has no mean of its own where every remounting is new: a common one is the fixture's.
    zero = deviates([zeros], [zero_own], aligned=True, level=0.5 * LEVEL)
    limit = f_quantile(1.0 - 0.5 * LEVEL / pattern.chance.size, 2.0, 2.0 * (len(dated) - 1.0)) * 2.0
    zero_limit = f_quantile(1.0 - 0.5 * LEVEL / len(dated), 1.0, len(dated) - 2.0)
    # Dates until a unit's charts together alarm where nothing moves, on average (h = 5 for one
    # chart).
    sum_limit = chart_limit(_ALLOWANCE, 465.44 * 2 * orders.size)
    found = []
    for u, calibrations in enumerate(dated):
        moved, zero_moved = bool(pattern.outlying[u]), bool(zero.outlying[u])
        places = tuple(pattern.outside(u, 0.5 * LEVEL))
        grows = _grows(calibrations, places[0], pattern) if moved else None
        change = np.concatenate([value[u] for value in values])
        squares = (change.reshape(-1, 2) ** 2).sum(axis=1)
        rare = 4.0 * between * math.log(pattern.chance.size / LEVEL)
        std = np.sqrt(np.concatenate([np.diag(s[u]) for s in own]))
        verdict = "changed" if grows is False else "recalibrate"
        verdict = verdict if moved else "zero_moved" if zero_moved else "fine"
        about_zero = zero_moved and not moved
        bound = drift_bound(change, std, orders, period)
        due = next_calibration(bound, calibrations, permitted)
        sums = charted(calibrations, pattern.variances)
        rows = []
        for at, (later, _) in enumerate(calibrations[1:]):
            last = later is calibrations[-1][0]
            of_zero = about_zero and last
            squares_of = [
                _statistic(later, calibrations, k, pattern.variances[k]) for k in range(orders.size)
            ]
            square = squares_of[places[0]]
            rows.append(
                HistoryRow(
                    calibrations[0][0].unit,
                    later.when or "",
                    None if of_zero else float(orders[places[0]]),
                    float(zero.size[u, 0] ** 2) if of_zero else square,
                    zero_limit if of_zero else limit,
                    verdict if last else "recalibrate" if square > limit else "fine",
                    due[0] if last else None,
                    due[1] if last else False,
                    bound if last else None,
                    sum_limit,
                    tuple(
                        HistoryOrder(*row)
                        for row in zip(orders.tolist(), squares_of, sums[at].tolist(), strict=True)
                    ),
                )
            )
        chance = min(float(pattern.unit[u]), float(zero.unit[u]))
        found.append(
            Change(
                calibrations[0][0].unit,
                moved,
                zero_moved,
                places,
                chance,
                pattern.limit if moved else zero.limit,
                float(zeros[u, 0]),
                change,
                std,
                grows,
                bool((squares > rare)[list(places)].any()),
                tuple(rows),
            )
        )
    return found


def _differences(
    dated: Sequence[Sequence[tuple[Calibration, float]]], period: float
) -> tuple[list[Array], list[Array], Array, Array]:
    """Change of every order and of the zero, and their covariances by the noise of readings."""
    pairs = [(calibrations[0], calibrations[-1]) for calibrations in dated]
    change = np.array([b.coefficients - a.coefficients for (a, _), (b, _) in pairs])
    blocks = np.array([s * a.blocks() + t * b.blocks() for (a, s), (b, t) in pairs])
    zero = wrap(np.array([b.zero - a.zero for (a, _), (b, _) in pairs]), period)
    spread = [s * a.zero_inverse + t * b.zero_inverse for (a, s), (b, t) in pairs]
    values = list(change.reshape(len(dated), -1, 2).transpose(1, 0, 2))
    own = list(blocks.transpose(1, 0, 2, 3))
    return values, own, zero[:, None], np.array(spread)[:, None, None]


def _statistic(
    later: Calibration,
    calibrations: Sequence[tuple[Calibration, float]],
    place: int,
    variance: float,
) -> float:
    """T^2 of one order of a date against the first."""
    first, noise = calibrations[0]
    order = slice(2 * place, 2 * place + 2)
    apart = later.coefficients[order] - first.coefficients[order]
    spread = noise * (later.blocks()[place] + first.blocks()[place])
    spread = spread + (variance + 1e-300) * np.eye(2)
    return wald_statistic(apart, spread)


def _grows(
    calibrations: Sequence[tuple[Calibration, float]], place: int, pattern: Deviates
) -> bool | None:
    """Whether a straight line in time leaves less than the best step; None with two dates."""
    if len(calibrations) < 3:
        return None
    order = slice(2 * place, 2 * place + 2)
    values = np.array([c.coefficients[order] for c, _ in calibrations])
    times = _days([c.when for c, _ in calibrations])
    line = times - times.mean()
    slope = line @ (values - values.mean(axis=0)) / float(line @ line)
    drift = float(((values - values.mean(axis=0) - np.outer(line, slope)) ** 2).sum())
    steps = []
    for i in range(1, len(values)):
        parts = (values[:i], values[i:])
        steps.append(sum(float(((p - p.mean(axis=0)) ** 2).sum()) for p in parts))
    return drift <= min(steps)


def _days(dates: Sequence[str | None]) -> Array:
    """Days from the first date."""
    times = [parsed_time(date) for date in dates]
    naive = [None if t is None else t.replace(tzinfo=None) for t in times]
    start = naive[0]
    return np.array(
        [math.nan if t is None or start is None else (t - start) / timedelta(days=1) for t in naive]
    )


def drift_bound(change: Array, std: Array, orders: Array, period: float) -> float:
    """That of 95 % of the greatest change over a turn."""
    places = order_columns(np.linspace(0.0, period, 360, endpoint=False), orders, period)
    # Quantile of the normal distribution for a one-sided bound of 95 %.
    return float((np.abs(places @ change) + 1.6448536269514722 * np.sqrt(places**2 @ std**2)).max())


def next_calibration(
    bound: float,
    calibrations: Sequence[tuple[Calibration, float]],
    permitted: float | None,
) -> tuple[str | None, bool]:
    """The day at which a drift of this bound reaches the permitted error, linearly in time.

    And whether that is extrapolated: beyond twice the measured time.
    """
    if permitted is None:
        return None, False
    start, end = (parsed_time(c.when) for c in (calibrations[0][0], calibrations[-1][0]))
    if start is None or end is None:
        return None, False
    days = (end.replace(tzinfo=None) - start.replace(tzinfo=None)) / timedelta(days=1)
    if not days > 0.0 or not bound > 0.0:
        return None, False
    until = permitted / bound * days
    due: datetime = end if until <= days else start + timedelta(days=min(until, 36500.0))
    return due.date().isoformat(), until > 2.0 * days


def charted(calibrations: Sequence[tuple[Calibration, float]], changes: Array) -> Array:
    """The larger sum of every order on every further date, shape (dates - 1, K).

    ::

        z_t = (b_t - b̄_{t-1}) / √(V_t + V̄_{t-1} / t),
        C±_t = max(0, C±_{t-1} ± z_t - 1/2)

    against the mean of the t dates before, so that the z are independent where nothing moves;
    V is the noise of a date and half of the variance of an ordinary change between two.

    Parameters
    ----------
    calibrations : sequence of (Calibration, float)
        In the order of their dates, with the variance of a reading.
    changes : ndarray, shape (K,)
        Variance of an ordinary change of each order's cosine and sine.
    """
    values = np.array([one.coefficients for one, _ in calibrations])
    own = np.array(
        [noise * np.diagonal(one.blocks(), axis1=1, axis2=2).ravel() for one, noise in calibrations]
    )
    spread = own + 0.5 * np.repeat(changes, 2) + 1e-300
    sums = np.zeros((2, values.shape[1]))
    found = []
    for t in range(1, len(values)):
        before = spread[:t].mean(axis=0) / t
        z = (values[t] - values[:t].mean(axis=0)) / np.sqrt(spread[t] + before)
        sums = np.maximum(0.0, sums + np.array([z, -z]) - _ALLOWANCE)
        found.append(sums.max(axis=0).reshape(-1, 2).max(axis=1))
    return np.array(found)
