"""The size of every order, on the axis of the orders, with breaks between the shafts' groups."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..plots.amplitudespectrum import likely_aliases, thresholds
from ..plots.curves import CONFIDENCE
from ..plots.orderaxis import order_groups
from ..support.angles import ARCSEC_PER_TURN
from .charts import Chart, Figure, figure
from .linenames import LineNames
from .scale import Scale

if TYPE_CHECKING:
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult

__all__ = ["spectrum"]

#: Half a letter of a name as part of a chart's width, and what parts names above each other.
_LETTER, _HIGHER = 0.012, 2.0
#: Orders written at their lines, the largest first.
_MOST_NAMED: Final = 8
#: Least amplitude of the logarithmic axis, as part of the smallest threshold or amplitude kept.
_FLOOR: Final = 0.2


def spectrum(
    fit: FitResult | None, selection: OrderSelection | None, name: LineNames, scale: Scale
) -> Figure:
    """Amplitude of every order: candidates of a selection, or the orders of a fit."""
    rows = _of_fit(fit, name) if selection is None else _of_selection(selection, name)
    # Orders that the travel does not tell apart have no size.
    rows = [row for row in rows if np.isfinite(row["amplitude"])]
    for row in rows:
        row |= {size: scale.factor * row[size] for size in ("amplitude", "half", "limit")}
    kept = [row for row in rows if row["kept"]]
    seen = [row["limit"] for row in rows if row["limit"] > 0.0]
    seen += [row["amplitude"] for row in (kept or rows) if row["amplitude"] > 0.0]
    floor = _FLOOR * min(seen, default=1.0)
    top = 3.0 * max([*(row["amplitude"] for row in rows), *seen, floor])
    named = sorted(kept, key=lambda row: -row["amplitude"])[:_MOST_NAMED]
    charts: list[Chart] = []
    for group in order_groups([row["order"] for row in rows]):
        inside = [row for row in rows if group[0] <= row["order"] <= group[1]]
        here = [row for row in named if row in inside]
        charts.append(_group(inside, group, (floor, top), here, scale, joined=bool(charts)))
    names = ", ".join(f"{row['order']:g}" for row in kept) or "none"
    what = "fitted orders with 95 % intervals" if selection is None else (
        "candidate orders with the threshold of significance"
    )  # fmt: skip
    alt = f"Amplitude in {scale.name} of {len(rows)} {what}. Retained: {names}."
    return figure(alt, charts, "joined")


def _group(
    rows: list[dict[str, Any]],
    group: tuple[float, float],
    y_range: tuple[float, float],
    named: list[dict[str, Any]],
    scale: Scale,
    joined: bool,
) -> Chart:
    low, high = group
    width = max(high - low, 4.0)
    margin = max(0.06 * width, 1.0)
    chart = Chart(
        "order" if joined else "order / cycles per output turn",
        f"amplitude / {scale.name}",
        x_range=(low - margin, high + margin),
        y_range=y_range,
        log_y=True,
        grow=max(float(np.sqrt(width)), 2.5),
        joined=joined,
    )
    chart.whole_axis(low, high, 3 if width < 8.0 else 8)
    half = min(0.35, 0.02 * (width + 2.0 * margin))
    for kept, colour, label in ((True, "after", "retained"), (False, "muted", "not retained")):
        some = [row for row in rows if row["kept"] is kept]
        if not some:
            continue
        x = np.array([row["order"] for row in some])
        size = np.maximum([row["amplitude"] for row in some], y_range[0])
        told = {"order": [f"{row['order']:g}" for row in some], "told": [r["told"] for r in some]}
        hover = f"order @order: {scale.read} @told"
        chart.stems(x, y_range[0], size, colour=colour, label=_once(label, joined))
        chart.dots(x, size, colour=colour, size=7.0, hover=hover, more=told, hollow=not kept)
    limited = [row for row in rows if row["limit"] > 0.0]
    if limited:
        chart.ticks(
            np.array([row["order"] for row in limited]),
            np.array([row["limit"] for row in limited]),
            half,
            colour="warning",
            label=_once("needed to be significant", joined),
        )
    ranged = [row for row in rows if row["half"] > 0.0]
    if ranged:
        x = np.array([row["order"] for row in ranged])
        middle = np.array([row["amplitude"] for row in ranged])
        spread = np.array([row["half"] for row in ranged])
        least = np.maximum(middle - spread, y_range[0])
        chart.stems(
            x,
            least,
            middle + spread,
            colour="fore",
            width=1.2,
            label="" if joined else "95 % interval",
        )
    written = _apart(named, low - margin, high + margin)
    chart.labels(
        np.array([row["order"] for row in written]),
        np.array([row["amplitude"] for row in written]),
        [row["name"] for row in written],
        (low - margin, high + margin),
    )
    return chart


def _once(label: str, joined: bool) -> str:
    """The first of joined charts has the legend of all."""
    return "" if joined else label


def _apart(named: list[dict[str, Any]], low: float, high: float) -> list[dict[str, Any]]:
    """Lines whose texts do not run into each other, the largest first."""
    taken: list[dict[str, Any]] = []
    for row in named:
        near = [
            t
            for t in taken
            if abs(t["order"] - row["order"])
            < _LETTER * (len(t["name"]) + len(row["name"])) * (high - low)
        ]
        if all(max(t["amplitude"], row["amplitude"]) > _HIGHER * min(t["amplitude"],
               row["amplitude"]) for t in near):  # fmt: skip
            taken.append(row)
    return taken


def _short(order: float, name: LineNames) -> str:
    """The name at a line: orders of the output have none but their number."""
    return name(order).removeprefix("output ")


def _of_fit(fit: FitResult | None, name: LineNames) -> list[dict[str, Any]]:
    assert fit is not None
    factor = ARCSEC_PER_TURN / fit.model.period
    known = fit.model.covariance is not None
    rows = [
        {
            "order": float(order),
            "amplitude": factor * float(fit.amplitudes[i]),
            "half": CONFIDENCE * factor * float(fit.amplitude_std[i]) if known else 0.0,
            "limit": 0.0,
            "kept": True,
            "told": f"({name(float(order))})",
            "name": _short(float(order), name),
        }
        for i, order in enumerate(fit.orders)
    ]
    return sorted(rows, key=lambda row: row["order"])


def _of_selection(selection: OrderSelection, name: LineNames) -> list[dict[str, Any]]:
    factor = ARCSEC_PER_TURN / selection.period
    limits = np.nan_to_num(factor * thresholds(selection), posinf=0.0)
    found = []
    for row, limit in zip(selection.table, limits, strict=True):
        told = [name(float(row.order)), row.verdict]
        if row.aliases:
            told.append("looks like order " + ", ".join(f"{m:g}" for m in likely_aliases(row)[:4]))
        told += [str(e) for e in row.explanations[:3]]
        found.append(
            {
                "order": float(row.order),
                "amplitude": factor * row.amplitude,
                "half": 0.0,
                "limit": float(limit),
                "kept": row.retained,
                "told": "(" + "; ".join(told) + ")",
                "name": _short(float(row.order), name),
            }
        )
    return found
