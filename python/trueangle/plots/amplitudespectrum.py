"""Amplitude of every order with the threshold it has to pass, retained ones marked."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..angles import ARCSEC_PER_TURN
from ..orders.selection import FALSE_ALARM
from ..orders.table import OrderRow, OrderSelection
from . import palette
from .canvas import legend, new_axes
from .curves import CONFIDENCE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult


__all__ = ["amplitude_spectrum", "likely_aliases", "thresholds"]

Array = NDArray[np.float64]

#: Up to so many orders each has a place of its own on the axis.
_MOST_NAMED = 40
#: Aliases and explanations written at a bar; the table has them all.
_MOST_ALIASES = 3
#: Bars that get their aliases written, the largest first.
_MOST_ANNOTATED = 12


def amplitude_spectrum(result: OrderSelection | FitResult, ax: Axes | None = None) -> Axes:
    """Amplitude against order: of all candidates of a selection, or of a fit's orders.

    Retained orders are filled, others hollow. The dashed steps are the amplitude that an
    order needs to be significant; aliases that the positions cannot tell from a retained
    order stand above its bar. A fit's bars carry 95 % intervals.

    Parameters
    ----------
    result : OrderSelection or FitResult
        A fit that selected its orders shows that selection.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    if isinstance(result, OrderSelection):
        return _of_selection(result, ax)
    selection = result.selection
    return _of_fit(result, ax) if selection is None else _of_selection(selection, ax)


def _of_fit(fit: FitResult, ax: Axes | None) -> Axes:
    ax = new_axes(ax)
    factor = ARCSEC_PER_TURN / fit.model.period
    ranks = np.argsort(fit.orders)
    place = _places(ax, [float(fit.orders[i]) for i in ranks])
    amplitude = factor * fit.amplitudes[ranks]
    std = None
    if fit.model.covariance is not None:
        std = CONFIDENCE * factor * fit.amplitude_std[ranks]
    ax.bar(
        place,
        amplitude,
        width=_width(place),
        color=palette.AFTER,
        yerr=std,
        ecolor=palette.MODEL,
        capsize=2.0,
        error_kw={"linewidth": 0.8},
        label="fitted amplitude, 95 % interval",
    )
    return _finish(ax)


def _of_selection(selection: OrderSelection, ax: Axes | None) -> Axes:
    ax = new_axes(ax)
    factor = ARCSEC_PER_TURN / selection.period
    rows = selection.table
    place = _places(ax, [float(row.order) for row in rows])
    width = _width(place)
    amplitude = np.array([factor * row.amplitude for row in rows])
    kept = np.array([row.retained for row in rows], dtype=bool)
    if kept.any():
        ax.bar(place[kept], amplitude[kept], width, color=palette.AFTER, label="retained")
    if not kept.all():
        ax.bar(
            place[~kept],
            amplitude[~kept],
            width,
            facecolor="none",
            edgecolor=palette.MUTED,
            linewidth=0.9,
            label="not retained",
        )
    limit = factor * thresholds(selection)
    if np.isfinite(limit).any():
        ax.hlines(
            limit,
            place - 0.5 * width,
            place + 0.5 * width,
            color=palette.WARNING,
            linewidth=1.6,
            label="needed to be significant",
        )
    tall = [i for i in np.argsort(-amplitude) if kept[i] and rows[i].aliases][:_MOST_ANNOTATED]
    for i in tall:
        likely = likely_aliases(rows[i])
        aliases = [f"{m:g}" for m in likely[:_MOST_ALIASES]]
        more = ", …" if len(likely) > _MOST_ALIASES else ""
        ax.annotate(
            f"or {', '.join(aliases)}{more}",
            (place[i], amplitude[i]),
            xytext=(0, 3),
            textcoords="offset points",
            rotation=90,
            ha="center",
            va="bottom",
            fontsize="x-small",
            color=palette.WARNING,
        )
    if tall:
        ax.set_ylim(0.0, 1.35 * float(np.nanmax(amplitude)))
    return _finish(ax)


def thresholds(selection: OrderSelection) -> Array:
    r"""Amplitude at which each order of the table would just be significant.

    .. math:: C = u \sqrt{T}, \qquad (1 + T/v)^{-v/2} = \alpha / K

    with the order's standard error u, v degrees of freedom of the noise and the chance
    alpha of a false alarm shared by the K orders of the table. Orders found by a wider scan
    had to pass more.
    """
    v = float(selection.noise.degrees_of_freedom)
    log_share = math.log(max(1, len(selection.table)) / FALSE_ALARM)
    needed = v * math.expm1(2.0 / v * log_share) if v > 0.0 else math.nan
    return np.array([row.standard_error * math.sqrt(needed) for row in selection.table])


def likely_aliases(row: OrderRow) -> tuple[float, ...]:
    """Aliases of an order, those that are known lines of the joint alone where there are any."""
    known = tuple(e.order for e in row.explanations if e.order != row.order)
    return known or row.aliases


def _places(ax: Axes, orders: list[float]) -> Array:
    """Where the bars stand: evenly, each with its name, while there are few."""
    if len(orders) > _MOST_NAMED:
        return np.asarray(orders, dtype=np.float64)
    place = np.arange(len(orders), dtype=np.float64)
    ax.set_xticks(place, [f"{m:g}" for m in orders], rotation=90 if len(orders) > 20 else 0)
    return place


def _width(place: Array) -> float:
    return 0.75 * float(np.diff(place).min(initial=1.0))


def _finish(ax: Axes) -> Axes:
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel("amplitude / arcsec")
    ax.grid(True, axis="y", color="#00000018", linewidth=0.8)
    ax.set_axisbelow(True)
    legend(ax)
    return ax
