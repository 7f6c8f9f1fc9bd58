"""Amplitude of every order with the threshold it has to pass, retained ones marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..fitting import summary as fitting_summary
from ..fitting.orders import summary as orders_summary
from ..fitting.orders.result import OrderSelection
from ..support.arrays import Array
from ..support.display_units import ErrorsIn
from ..support.layout import counted
from . import palette
from .canvas import described, grid, legend, new_axes
from .orderaxis import OrderAxis
from .orderlines import largest_orders_text, order_lines, seen_sizes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult


#: Aliases and explanations written at a dot; the table has them all.
_MOST_ALIASES = 3
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
    orders = [line.order for line in lines]
    axis = OrderAxis.of(orders)
    ax = new_axes(ax)
    place, width = axis.places(orders), axis.width(orders)
    amplitude, half, limit = (
        unit.per_arcsec * np.array([getattr(line, name) for line in lines])
        for name in ("amplitude", "half", "limit")
    )
    kept = np.array([line.kept for line in lines], dtype=bool)
    fitted = selection is None
    for chosen, colour, face, label in (
        (kept, palette.AFTER, palette.AFTER, "fitted, 95 % interval" if fitted else "retained"),
        (~kept, palette.MUTED, "none", "not retained"),
    ):
        if chosen.any():
            ax.errorbar(
                place[chosen],
                amplitude[chosen],
                yerr=[np.minimum(half, 0.999 * amplitude)[chosen], half[chosen]]
                if fitted
                else None,
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
    told = limit > 0.0
    if told.any():
        ax.hlines(
            limit[told],
            (place - 0.6 * width)[told],
            (place + 0.6 * width)[told],
            color=palette.WARNING,
            linewidth=1.6,
            label="needed to be significant",
        )
    confused = [i for i in np.argsort(-amplitude) if kept[i] and lines[i].aliases]
    tall = _apart(confused, place, axis.room(ax, _LABEL_INCHES))[:_MOST_ANNOTATED]
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
    ax.set_yscale("log")
    # A decade above for aliases that are written there.
    ax.set_ylim(low, 1.5 * high * (10.0 if tall else 1.0))
    axis.draw(ax)
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel(f"amplitude / {unit.name}")
    grid(ax, "y")
    legend(ax)
    named = largest_orders_text(lines, unit)
    what = f"{counted(lines, 'fitted order')}: {named}" if fitted else (
        f"{counted(lines, 'candidate order')}. Retained: {named}"
    )  # fmt: skip
    return described(ax, f"Amplitude of {what}.")


def _apart(ranked: Sequence[np.intp], place: Array, room: float) -> list[np.intp]:
    """Of dots, the most important first, those that have room beside the ones before."""
    kept: list[np.intp] = []
    for i in ranked:
        if all(abs(place[i] - place[k]) >= room for k in kept):
            kept.append(i)
    return kept
