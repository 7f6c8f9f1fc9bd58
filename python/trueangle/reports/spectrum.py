"""The size of every order, on the axis of the orders, with breaks between the shafts' groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..plots.orderaxis import order_groups
from ..plots.orderlines import OrderLine, order_lines, seen_sizes
from .charts import Chart, Figure, chart_figure
from .linenames import LineNames
from .scale import ErrorScale

if TYPE_CHECKING:
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult

#: Half a letter of a name as part of a chart's width, and what parts names above each other.
_LETTER, _HIGHER = 0.012, 2.0
#: A dot this much larger than the lowest size shown is whole, and so much above or below another
#: it is clear of it.
_WHOLE, _CLEAR = 1.12, 1.1
#: Orders written at their dots, the largest first.
_MOST_NAMED: Final = 8
#: Aliases and explanations that are shown over a dot.
_MOST_ALIASES, _MOST_EXPLANATIONS = 4, 3


def spectrum_figure(
    fit: FitResult | None, selection: OrderSelection | None, name: LineNames, scale: ErrorScale
) -> Figure:
    """Amplitude of every order: candidates of a selection, or the orders of a fit."""
    result = fit if selection is None else selection
    assert result is not None
    lines = order_lines(result)
    low, high = (scale.factor * size for size in seen_sizes(lines))
    kept = [line for line in lines if line.kept]
    named = sorted(kept, key=lambda line: -line.amplitude)[:_MOST_NAMED]
    charts: list[Chart] = []
    for group in order_groups([line.order for line in lines]):
        inside = [line for line in lines if group[0] <= line.order <= group[1]]
        here = [line for line in named if line in inside]
        charts.append(_group(inside, group, (low, 3.0 * high), here, scale, name, bool(charts)))
    names = ", ".join(f"{line.order:g}" for line in kept) or "none"
    what = "fitted orders with 95 % intervals" if selection is None else (
        "candidate orders with the threshold of significance"
    )  # fmt: skip
    alt = f"Amplitude in {scale.name} of {len(lines)} {what}. Retained: {names}."
    return chart_figure(alt, charts, "joined")


def _group(
    lines: Sequence[OrderLine],
    group: tuple[float, float],
    y_range: tuple[float, float],
    named: Sequence[OrderLine],
    scale: ErrorScale,
    name: LineNames,
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
    for kept, colour, label in ((True, "after", "retained"), (False, "muted", "not retained")):
        # What is far below every threshold would be half a dot at the border.
        some = [
            line
            for line in lines
            if line.kept is kept and scale.factor * line.amplitude >= _WHOLE * y_range[0]
        ]
        if some:
            # No stems: on a logarithmic axis their lengths would mean nothing.
            chart.dots(
                _orders(some),
                _sizes(some, "amplitude", scale),
                colour=colour,
                size=7.0,
                label=_once(label, joined),
                hover=f"order @order: {scale.read} @told",
                more={
                    "order": [f"{line.order:g}" for line in some],
                    "told": [_told(line, name) for line in some],
                },
                hollow=not kept,
            )
    limited = [line for line in lines if line.limit > 0.0]
    if limited:
        chart.ticks(
            _orders(limited),
            _sizes(limited, "limit", scale),
            min(0.35, 0.02 * (width + 2.0 * margin)),
            colour="warning",
            label=_once("needed to be significant", joined),
        )
    ranged = [line for line in lines if line.half > 0.0]
    if ranged:
        middle, spread = (_sizes(ranged, size, scale) for size in ("amplitude", "half"))
        chart.stems(
            _orders(ranged),
            np.maximum(middle - spread, y_range[0]),
            middle + spread,
            colour="fore",
            width=1.2,
            label=_once("95 % interval", joined),
        )
    borders = (low - margin, high + margin)
    sides = _sides(_apart(named, *borders, name), lines, *borders, name)
    written = list(sides)
    chart.labels(
        _orders(written),
        _sizes(written, "amplitude", scale),
        [_short(line.order, name) for line in written],
        borders,
        [sides[line] for line in written],
    )
    return chart


def _sides(
    named: Sequence[OrderLine],
    lines: Sequence[OrderLine],
    low: float,
    high: float,
    name: LineNames,
) -> dict[OrderLine, bool]:
    """Names that stand on no dot: above theirs, or below (True); those in the way are left out."""
    found = {}
    for line in named:
        reach = _LETTER * 2.0 * len(_short(line.order, name)) * (high - low)
        sizes = [
            other.amplitude / line.amplitude
            for other in lines
            if other is not line and abs(other.order - line.order) < reach
        ]
        if not any(1.0 / _CLEAR < size < _HIGHER for size in sizes):
            found[line] = False
        elif not any(1.0 / _HIGHER < size < _CLEAR for size in sizes):
            found[line] = True
    return found


def _orders(lines: Sequence[OrderLine]) -> NDArray[np.float64]:
    return np.array([line.order for line in lines])


def _sizes(lines: Sequence[OrderLine], size: str, scale: ErrorScale) -> NDArray[np.float64]:
    """A size of every line in the unit of the page."""
    return scale.factor * np.array([getattr(line, size) for line in lines])


def _once(label: str, joined: bool) -> str:
    """The first of joined charts has the legend of all."""
    return "" if joined else label


def _apart(named: Sequence[OrderLine], low: float, high: float, name: LineNames) -> list[OrderLine]:
    """Lines whose texts do not run into each other, the largest first."""
    taken: list[OrderLine] = []
    for line in named:
        near = [
            other
            for other in taken
            if abs(other.order - line.order)
            < _LETTER
            * (len(_short(other.order, name)) + len(_short(line.order, name)))
            * (high - low)
        ]
        sizes = [sorted((other.amplitude, line.amplitude)) for other in near]
        if all(large > _HIGHER * small for small, large in sizes):
            taken.append(line)
    return taken


def _short(order: float, name: LineNames) -> str:
    """The name at a dot: orders of the output have none but their number."""
    return name(order).removeprefix("output ")


def _told(line: OrderLine, name: LineNames) -> str:
    """What is shown over a dot beside its size."""
    told = [name(line.order)]
    if line.row is not None:
        told.append(line.row.verdict)
        if line.aliases:
            aliases = ", ".join(f"{m:g}" for m in line.aliases[:_MOST_ALIASES])
            told.append(f"looks like order {aliases}")
        told += [str(e) for e in line.row.explanations[:_MOST_EXPLANATIONS]]
    return f"({'; '.join(told)})"
