"""The verdict on one unit: which orders stand out or moved, and what that is likely to be."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..joint.joint import Joint
from ..support.angles import arcsec
from .history import Change
from .outliers import Deviates
from .unit import FleetUnit, UnitOrder, Verdict
from .units import FEWEST, Units

__all__ = ["unit_row"]


def unit_row(
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
            UnitOrder(
                order,
                math.hypot(a, b),
                math.degrees(math.atan2(a, b)) % 360.0,
                float(std),
                float(z),
            )
            for order, (a, b), std, z in zip(
                units.orders.tolist(), pairs.tolist(), stds, found.size[u], strict=True
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
        return f"far from the others, which are too few to tell damage by: {FEWEST} are needed"
    return (
        "far from the others, as a quarter of the units are before it: a wide design, or several "
        "designs, and not damage of one"
    )


def _outlying(units: Units, u: int, found: Deviates, joint: Joint) -> str:
    """Which orders, and what they are likely to be."""
    places = found.orders(u)
    told = [
        f"order {units.orders[k]:g} is {found.size[u, k]:.1f} standard deviations from the others"
        for k in places[:3]
    ]
    cause = joint.explanations(float(units.orders[places[0]]))[0]
    return f"{', '.join(told)}: {cause}"


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
    slow = "it grows slowly" if change.grows else "two dates do not tell a drift from a step"
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
