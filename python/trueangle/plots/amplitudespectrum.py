"""Amplitude of every order with the threshold it has to pass, retained ones marked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..fitting import summary as fitting_summary
from ..fitting.orders import summary as orders_summary
from ..fitting.orders.selection import FALSE_ALARM
from ..fitting.orders.table import OrderRow, OrderSelection
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import ErrorsIn, ErrorUnit, significant
from . import palette
from .canvas import described, grid, legend, new_axes
from .curves import CONFIDENCE
from .orderaxis import OrderAxis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult


__all__ = ["amplitude_spectrum", "likely_aliases", "thresholds"]

Array = NDArray[np.float64]

#: Orders told in words.
_TOLD = 6
#: Least amplitude of the logarithmic axis, as part of the smallest that has to be seen.
_FLOOR = 0.2
#: Aliases and explanations written at a bar; the table has them all.
_MOST_ALIASES = 3
#: Bars that get their aliases written, the largest first, and inches that each needs.
_MOST_ANNOTATED = 12
_LABEL_INCHES = 0.17


def amplitude_spectrum(
    result: OrderSelection | FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Amplitude against order: of all candidates of a selection, or of a fit's orders.

    The axis of orders is broken where none was looked at; that of amplitudes is logarithmic.

    Retained orders are filled, others hollow. The dashed steps are the amplitude that an
    order needs to be significant; aliases that the positions cannot tell from a retained
    order stand above its bar. A fit's bars carry 95 % intervals.

    Parameters
    ----------
    result : OrderSelection or FitResult
        A fit that selected its orders shows that selection.
    ax : matplotlib Axes, optional
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

    Returns
    -------
    matplotlib Axes
    """
    if isinstance(result, OrderSelection):
        return _of_selection(result, ax, errors_in)
    if result.selection is None:
        return _of_fit(result, ax, errors_in)
    return _of_selection(result.selection, ax, errors_in)


def _of_fit(fit: FitResult, ax: Axes | None, errors_in: ErrorsIn) -> Axes:
    unit = fitting_summary.unit_of(fit, errors_in)
    factor = unit.per_arcsec * (ARCSEC_PER_TURN / fit.model.period)
    ranks = np.argsort(fit.orders)
    orders = [float(fit.orders[i]) for i in ranks]
    amplitude = factor * fit.amplitudes[ranks]
    std = None
    if fit.model.covariance is not None:
        std = CONFIDENCE * factor * fit.amplitude_std[ranks]
    ax = new_axes(ax)
    axis = OrderAxis.of(orders)
    ax.bar(
        axis.places(orders),
        amplitude,
        width=axis.width(orders),
        color=palette.AFTER,
        yerr=None if std is None else [np.minimum(std, 0.999 * amplitude), std],
        ecolor=palette.ink(ax),
        capsize=2.0,
        error_kw={"linewidth": 0.8},
        label="fitted amplitude, 95 % interval",
    )
    described(ax, f"Amplitude of {len(orders)} fitted orders: {_largest(orders, amplitude, unit)}.")
    return _finish(ax, axis, amplitude, unit)


def _of_selection(selection: OrderSelection, ax: Axes | None, errors_in: ErrorsIn) -> Axes:
    rows = selection.table
    sizes = np.array([row.amplitude for row in rows])
    unit = orders_summary.unit_of(selection, errors_in)
    factor = unit.per_arcsec * (ARCSEC_PER_TURN / selection.period)
    orders = [float(row.order) for row in rows]
    axis = OrderAxis.of(orders)
    ax = new_axes(ax)
    place, width = axis.places(orders), axis.width(orders)
    amplitude = factor * sizes
    kept = np.array([row.retained for row in rows], dtype=bool)
    limit = factor * thresholds(selection)
    if kept.any():
        ax.bar(place[kept], amplitude[kept], width[kept], color=palette.AFTER, label="retained")
    if not kept.all():
        ax.bar(
            place[~kept],
            amplitude[~kept],
            width[~kept],
            facecolor="none",
            edgecolor=palette.MUTED,
            linewidth=0.9,
            label="not retained",
        )
    if np.isfinite(limit).any():
        ax.hlines(
            limit,
            place - 0.6 * width,
            place + 0.6 * width,
            color=palette.WARNING,
            linewidth=1.6,
            label="needed to be significant",
        )
    confused = [i for i in np.argsort(-amplitude) if kept[i] and rows[i].aliases]
    tall = _apart(confused, place, axis.room(ax, _LABEL_INCHES))[:_MOST_ANNOTATED]
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
    names = [order for order, keep in zip(orders, kept, strict=True) if keep]
    told = _largest(names, amplitude[kept], unit) if names else "none"
    described(ax, f"Amplitude of {len(rows)} candidate orders. Retained: {told}.")
    shown = np.concatenate([amplitude[kept], limit[np.isfinite(limit)]])
    return _finish(ax, axis, shown if shown.size else amplitude, unit, 1.0 if tall else 0.0)


def _apart(ranked: Sequence[np.intp], place: Array, room: float) -> list[np.intp]:
    """Of bars, the most important first, those that have room beside the ones before."""
    kept: list[np.intp] = []
    for i in ranked:
        if all(abs(place[i] - place[k]) >= room for k in kept):
            kept.append(i)
    return kept


def _largest(orders: list[float], amplitude: Array, unit: ErrorUnit) -> str:
    """The largest orders with their amplitudes, and how many more there are."""
    ranks = np.argsort(-amplitude)
    told = [
        f"{orders[i]:g} ({significant(float(amplitude[i]), 3)} {unit.name})" for i in ranks[:_TOLD]
    ]
    more = f" and {len(orders) - _TOLD} smaller ones" if len(orders) > _TOLD else ""
    return ", ".join(told) + more


def thresholds(selection: OrderSelection) -> Array:
    r"""Amplitude at which each order of the table would just be significant.

    .. math:: C = C_k \sqrt{T / T_k}, \qquad (1 + T/v)^{-v/2} = \alpha / K

    with the order's amplitude and statistic, v degrees of freedom of the noise and the chance
    alpha of a false alarm shared by the K orders of the table. Orders found by a wider scan
    had to pass more.
    """
    v = float(selection.noise.degrees_of_freedom)
    log_share = math.log(max(1, len(selection.table)) / FALSE_ALARM)
    needed = v * math.expm1(2.0 / v * log_share) if v > 0.0 else math.nan
    return np.array(
        [
            row.amplitude * math.sqrt(needed / row.statistic) if row.statistic > 0.0 else math.nan
            for row in selection.table
        ]
    )


def likely_aliases(row: OrderRow) -> tuple[float, ...]:
    """Aliases of an order, those that are known lines of the joint alone where there are any."""
    known = tuple(e.order for e in row.explanations if e.order != row.order)
    return known or row.aliases


def _finish(ax: Axes, axis: OrderAxis, sizes: Array, unit: ErrorUnit, room: float = 0.0) -> Axes:
    """Axes and legend; ``sizes`` have to be seen, ``room`` decades above them stay free."""
    seen = sizes[np.isfinite(sizes) & (sizes > 0.0)]
    low = _FLOOR * float(seen.min(initial=1.0)) if seen.size else 0.1
    high = float(seen.max(initial=low)) if seen.size else 1.0
    ax.set_yscale("log")
    ax.set_ylim(low, 1.5 * high * 10.0**room)
    axis.draw(ax)
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel(f"amplitude / {unit.name}")
    grid(ax, "y")
    legend(ax)
    return ax
