"""Verdicts of the units and what the fleet is like, from its units side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..fitting.fit import ROUNDING
from ..fitting.prior import Prior
from ..joint.joint import Joint
from .calibration import Calibration
from .history import Change, changes_of
from .result import BetweenOrder, CommonOrder, Fleet
from .tolerance import tolerance_of
from .unit import VERDICTS
from .units import FEWEST, SharedPattern, Units, pattern_of
from .verdict import unit_row

__all__ = ["judged"]


def judged(
    units: Units,
    joint: Joint,
    share: float,
    confidence: float,
    permitted: float | None,
    notes: list[str],
) -> Fleet:
    """Verdicts, and what the fleet is like."""
    n = len(units.last)
    chosen = pattern_of(units, aligned=False)
    if n > 2:
        shared = pattern_of(units, aligned=True)
        both = shared.belong & chosen.belong
        if float((shared.scores - chosen.scores)[both].sum()) > 0.0:
            chosen = shared
    if n < FEWEST:
        notes.append(f"{n} units do not tell which of them is an outlier: {FEWEST} are needed.")
    again = [dates for dates in units.dated if len(dates) > 1]
    spread = np.array([one.variance for one in chosen.between])
    changes = {
        change.unit: change
        for change in changes_of(again, units.orders, units.period, spread, permitted)
    }
    if again and not changes:
        notes.append(
            f"{len(again)} units calibrated again do not tell what an ordinary change is: "
            "4 are needed."
        )
    belong = chosen.belong
    # Below rounding the logarithms are of nothing.
    least = ROUNDING * units.period
    sizes, left = (np.maximum(v[belong], least) for v in (units.peak_to_peak, units.left))
    bound = tolerance_of(sizes, left, share, confidence)
    if not belong.all():
        notes.append(
            f"Common pattern, spread and tolerance limits are those of the {int(belong.sum())} "
            "units that are no outliers."
        )
    elif chosen.deviates.outlying.any():
        notes.append(
            f"{int(chosen.deviates.outlying.sum())} of {n} units are outliers, more than damage "
            "explains: is the fleet of several designs? They are counted in its spread and limits."
        )
    names = [(shaft.name, k) for shaft in units.shafts for k in shaft.orders]
    repeats = _repeatability(units)
    rows = zip(units.orders.tolist(), names, chosen.between, strict=True)
    ranked = sorted(
        (unit_row(units, u, chosen.deviates, changes, joint) for u in range(n)),
        key=lambda unit: (VERDICTS.index(unit.verdict), unit.p),
    )
    return Fleet(
        tuple(ranked),
        tuple(
            CommonOrder(
                order,
                shaft,
                float(one.mean[0]),
                float(one.mean[1]),
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
        tuple(row for dates in again for row in _rows(dates, changes)),
        chosen.aligned,
        _prior(units, chosen),
        tuple(notes),
    )


def _rows(dates: Sequence[tuple[Calibration, float]], changes: Mapping[str, Change]) -> Any:
    change = changes.get(dates[0][0].unit)
    return () if change is None else change.rows


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
        max(2.0 * (kept - float(chosen.aligned)), 1.0),
        max(units.noise.variance, 1e-30 * units.period**2),
        units.noise.freedom,
        kept,
    )


def _repeatability(units: Units) -> list[float | None]:
    """Standard deviation of one run's coefficients about its unit's, by order."""
    freedom = sum(one.repeat_freedom for dates in units.dated for one, _ in dates)
    if not freedom:
        return [None] * units.orders.size
    squares = np.sum([one.repeat_squares for dates in units.dated for one, _ in dates], axis=0)
    return [math.sqrt(float(square) / freedom) for square in squares]
