"""Amplitude of every order with the threshold it has to pass, over an axis with breaks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..fitting import summary as fitting_summary
from ..fitting.orders import summary as orders_summary
from ..fitting.orders.result import OrderSelection
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit
from ..support.layout import counted
from . import palette
from .canvas import described, grid, legend, marked, new_axes, plain_logarithms
from .orderlines import OrderLine, largest_orders_text, order_lines, seen_sizes
from .palette import ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult


#: Aliases and explanations written at a dot; the table has them all.
_MOST_ALIASES = 3

#: Width of a group of one order, and the gap between two, in the unit of `_width`.
_LEAST, _GAP = 2.5, 1.0
#: Inches that a tick needs, and each digit at it.
_TICK_INCHES, _DIGIT_INCHES = 0.12, 0.09


def amplitude_spectrum(
    result: OrderSelection | FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Amplitude against order: of all candidates of a selection, or of a fit's orders.

    The axis of orders is broken where none was looked at; that of amplitudes is logarithmic.

    Retained orders are filled dots, others hollow: on such an axis the length of a bar would
    mean nothing. The steps are the amplitude that an order needs to be significant; aliases
    that the positions cannot distinguish from a retained order are above its dot. The orders of a
    fit carry 95 % intervals.

    Parameters
    ----------
    result : OrderSelection or FitResult
        A fit that selected its orders shows that selection.
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes
    """
    selection = result if isinstance(result, OrderSelection) else result.selection
    unit = (
        orders_summary.selection_error_unit(selection, errors_in)
        if selection is not None
        else fitting_summary.fit_error_unit(result, errors_in)  # type: ignore[arg-type]
    )
    lines = order_lines(result)
    ax = new_axes(ax)
    draw_spectrum(ax, lines, unit, fitted=selection is None)
    legend(ax)
    text = spectrum_text(lines, unit, fitted=selection is None)
    return described(ax, text, "Amplitude of every order")


def spectrum_text(lines: Sequence[OrderLine], unit: ErrorUnit, *, fitted: bool) -> str:
    """The picture of some orders in a sentence."""
    named = largest_orders_text(lines, unit)
    if fitted:
        return f"Amplitude of {counted(lines, 'fitted order')}: {named}."
    return f"Amplitude of {counted(lines, 'candidate order')}. Retained: {named}."


def draw_spectrum(
    ax: Axes,
    lines: Sequence[OrderLine],
    unit: ErrorUnit,
    *,
    fitted: bool,
    name: Callable[[float], str] | None = None,
) -> None:
    """Amplitudes, thresholds and aliases of orders; with ``name`` also what the largest are."""
    axis = OrderAxis.of([line.order for line in lines])
    place = axis.places([line.order for line in lines])
    width = axis.width([line.order for line in lines])
    amplitude, half, limit = (
        unit.per_arcsec * np.array([getattr(line, size) for line in lines])
        for size in ("amplitude", "half", "limit")
    )
    kept = np.array([line.kept for line in lines], dtype=bool)
    for chosen, colour, face, label in (
        (kept, palette.AFTER, palette.AFTER, "fitted, 95 % interval" if fitted else "retained"),
        (~kept, palette.MUTED, "none", "not retained"),
    ):
        if chosen.any():
            bars = [np.minimum(half, 0.999 * amplitude)[chosen], half[chosen]]
            drawn = ax.errorbar(
                place[chosen],
                amplitude[chosen],
                yerr=bars if fitted else None,
                linestyle="none",
                marker="o",
                markersize=5.0,
                markerfacecolor=face,
                color=colour,
                ecolor=palette.ink(ax),
                elinewidth=0.8,
                capsize=2.0,
                label=label,
            )
            titles = [_title(lines[i], unit, name) for i in np.flatnonzero(chosen).tolist()]
            marked(drawn.lines[0], ring=face == "none", titles=titles)
    known = limit > 0.0
    if known.any():
        ax.hlines(
            limit[known],
            (place - 0.6 * width)[known],
            (place + 0.6 * width)[known],
            color=palette.WARNING,
            linewidth=1.6,
            label="needed to be significant",
        )
    largest = [int(i) for i in np.argsort(-amplitude) if kept[i]]
    tall = _apart([i for i in largest if lines[i].aliases], place, axis.room(ax, 0.17))
    # Dots that get their aliases written, the largest first, and inches that each needs.
    tall = tall[:12]
    if name is not None:
        # Orders named on a page, the largest.
        for i in largest[:8]:
            text = name(lines[i].order).removeprefix("output ")
            ax.annotate(text, (place[i], amplitude[i]))
        tall = []
    for i in tall:
        likely = lines[i].aliases
        aliases = [f"{m:g}" for m in likely[:_MOST_ALIASES]]
        more = ", …" if len(likely) > _MOST_ALIASES else ""
        ax.annotate(
            f"or {', '.join(aliases)}{more}",
            (place[i], amplitude[i]),
            xytext=(0, 5),
            textcoords="offset points",
            rotation=90,
            ha="center",
            va="bottom",
            fontsize="x-small",
            color=palette.WARNING,
        )
    low, high = (unit.per_arcsec * size for size in seen_sizes(lines))
    # A decade above for aliases that are written there; limits first: amplitudes may all be nought.
    ax.set_ylim(low, (2.5 if name is not None else 1.5) * high * (10.0 if tall else 1.0))
    ax.set_yscale("log")
    plain_logarithms(ax, "y")
    axis.draw(ax)
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel(f"amplitude / {unit.name}")
    grid(ax, "y")


def _title(line: OrderLine, unit: ErrorUnit, name: Callable[[float], str] | None) -> str:
    """What a page shows over a dot."""
    about = [] if name is None else [name(line.order)]
    if line.row is not None:
        about.append(line.row.verdict)
        if line.aliases:
            aliases = ", ".join(f"{m:g}" for m in line.aliases[:_MOST_ALIASES])
            about.append(f"looks like order {aliases}")
        about += [str(e) for e in line.row.explanations[:_MOST_ALIASES]]
    size = f"order {line.order:g}: {unit.text(line.amplitude)}"
    return f"{size} ({'; '.join(about)})" if about else size


def _apart(ranked: Sequence[int], place: Array, room: float) -> list[int]:
    """Of dots, the most important first, those that have room next to the ones before."""
    kept: list[int] = []
    for i in ranked:
        if all(abs(place[i] - place[k]) >= room for k in kept):
            kept.append(i)
    return kept


def _order_groups(orders: Sequence[float]) -> list[tuple[float, float]]:
    """First and last order of every group; groups are broken at the widest gaps.

    Examples
    --------
    >>> _order_groups([1, 2, 5, 100, 101, 202])
    [(1.0, 5.0), (100.0, 101.0), (202.0, 202.0)]
    """
    ascending = np.unique(np.asarray(orders, dtype=np.float64))
    gaps = np.diff(ascending)
    # A gap of this many orders in which none was tested separates two groups.
    # Six groups side by side at most; more would leave no width for each.
    wide = [int(i) for i in np.argsort(-gaps) if gaps[i] > 12.0][:5]
    edges = [0, *sorted(i + 1 for i in wide), ascending.size]
    return [(float(ascending[a]), float(ascending[b - 1])) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class OrderAxis:
    """The places of orders on one axis with breaks.

    Attributes
    ----------
    groups : list of (float, float)
        First and last order of every group.
    starts, scales : list of float
        Place of every group's first order, and places for one order within it.
    """

    groups: list[tuple[float, float]]
    starts: list[float]
    scales: list[float]

    @classmethod
    def of(cls, orders: Sequence[float]) -> OrderAxis:
        """The axis of some orders; a group is as wide as the root of what it spans."""
        groups = _order_groups(orders)
        starts, scales, at = [], [], 0.0
        for low, high in groups:
            width = max(math.sqrt(high - low), _LEAST) if high > low else _LEAST
            margin = 0.06 * width
            starts.append(at + margin + (0.5 * (width - 2.0 * margin) if high == low else 0.0))
            scales.append((width - 2.0 * margin) / (high - low) if high > low else 1.0)
            at += width + _GAP
        return cls(groups, starts, scales)

    def places(self, orders: ArrayLike) -> Array:
        """The places of orders on the axis."""
        wanted = np.asarray(orders, dtype=np.float64)
        group = np.searchsorted([low for low, _ in self.groups], wanted, side="right") - 1
        first = np.array([low for low, _ in self.groups])[group]
        return np.asarray(
            np.array(self.starts)[group] + np.array(self.scales)[group] * (wanted - first)
        )

    def width(self, orders: ArrayLike) -> Array:
        """Widths of bars that do not touch."""
        place = np.sort(self.places(orders))
        least = float(np.diff(place).min(initial=0.5))
        return np.full(place.size, 0.75 * min(least, 0.5))

    def room(self, ax: Axes, inches: float) -> float:
        """How far these inches reach on these axes, in its places."""
        figure = ax.get_figure(root=True)
        wide = ax.get_position().width * figure.get_figwidth()  # type: ignore[union-attr]
        return inches * sum(self._spans()) / wide

    def draw(self, ax: Axes) -> None:
        """Ticks at whole orders, and marks where the axis is broken."""
        ticks: list[float] = []
        share = 1.0 / self.room(ax, 1.0)
        for (low, high), span in zip(self.groups, self._spans(), strict=True):
            room = _TICK_INCHES + _DIGIT_INCHES * len(f"{high:g}")
            most = max(2, int(share * span / room)) if high > low else 1
            ticks += _whole_ticks(low, high, most)
        ax.set_xticks(self.places(ticks), [f"{m:g}" for m in ticks])
        if max(ticks, default=0.0) >= 100.0:
            ax.tick_params(axis="x", labelsize="small")
        ends = self.places([high for _, high in self.groups])
        ax.set_xlim(self.starts[0] - 0.8, float(ends[-1]) + 0.8)
        for end, start in _pairwise_gaps(ends, self.starts):
            middle = 0.5 * (end + start)
            for side in (-0.09, 0.09):
                ax.plot(
                    [middle + side - 0.09, middle + side + 0.09],
                    [-0.025, 0.025],
                    transform=ax.get_xaxis_transform(),
                    color=ink(ax),
                    linewidth=1.0,
                    clip_on=False,
                    label="_break",
                )
            ax.axvline(middle, color=ink(ax) + "30", linewidth=0.8, linestyle=":", zorder=0.0)

    def _spans(self) -> list[float]:
        return [
            max((high - low) * scale, _LEAST)
            for (low, high), scale in zip(self.groups, self.scales, strict=True)
        ]


def _pairwise_gaps(ends: Array, starts: Sequence[float]) -> list[tuple[float, float]]:
    """End of each group and start of the next."""
    return [(float(end), float(start)) for end, start in zip(ends[:-1], starts[1:], strict=True)]


def _whole_ticks(low: float, high: float, most: int) -> list[float]:
    """Whole orders from ``low`` to ``high``, both named, at a step of 1, 2 or 5 times ten."""
    if high == low:
        return [low]
    steps = (m * 10**e for e in range(6) for m in (1, 2, 5))
    step = next(s for s in steps if (high - low) / s <= most)
    inner = [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
    kept = [float(k) for k in inner if low + 0.6 * step <= k <= high - 0.6 * step]
    return [low, *kept, high]
