"""Amplitude of every order with the threshold it has to pass, retained ones marked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..fitting import summary as fitting_summary
from ..fitting.orders import summary as orders_summary
from ..fitting.orders.result import OrderSelection
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit
from ..support.layout import counted
from . import palette
from .canvas import described, grid, legend, marked, new_axes, plain_logarithms
from .orderaxis import OrderAxis
from .orderlines import OrderLine, largest_orders_text, order_lines, seen_sizes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult


#: Aliases and explanations written at a dot; the table has them all.
_MOST_ALIASES = 3
#: Orders named on a page, the largest.
_MOST_NAMED = 8
#: Dots that get their aliases written, the largest first, and inches that each needs.
_MOST_ANNOTATED = 12
_LABEL_INCHES = 0.17


def amplitude_spectrum(
    result: OrderSelection | FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Amplitude against order: of all candidates of a selection, or of a fit's orders.

    The axis of orders is broken where none was looked at; that of amplitudes is logarithmic.

    Retained orders are filled dots, others hollow: on such an axis the length of a bar would
    mean nothing. The steps are the amplitude that an order needs to be significant; aliases
    that the positions cannot tell from a retained order stand above its dot. The orders of a
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
    tall = _apart([i for i in largest if lines[i].aliases], place, axis.room(ax, _LABEL_INCHES))
    tall = tall[:_MOST_ANNOTATED]
    if name is not None:
        for i in largest[:_MOST_NAMED]:
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
    """Of dots, the most important first, those that have room beside the ones before."""
    kept: list[int] = []
    for i in ranked:
        if all(abs(place[i] - place[k]) >= room for k in kept):
            kept.append(i)
    return kept
