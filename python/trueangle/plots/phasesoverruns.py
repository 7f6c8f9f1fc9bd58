"""Phase of every order over the runs, on polar axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..fitting.phases import Phases, run_phases
from ..fitting.summary import fit_error_unit
from ..support.display_units import ErrorsIn, ErrorUnit
from . import palette
from .canvas import described, grid, marked, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

#: Orders plotted by default, the largest first: beyond that colours repeat too often.
_MOST_ORDERS = 12
_TITLE = "Phase and amplitude of every order, run by run"


def phases_over_runs(
    fit: FitResult,
    ax: Axes | None = None,
    most: int = _MOST_ORDERS,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Phase (angle) and amplitude (radius) of every order in every run.

    A point is one run fitted by itself with the fit's orders; points of one order that
    stay together are a systematic error, points spread around the turn are none.

    Parameters
    ----------
    fit : FitResult
    ax : matplotlib PolarAxes, optional
    most : int
        Draw only this many orders, the largest.
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib PolarAxes

    Raises
    ------
    RankError
        No run holds the orders by itself.
    """
    found = sorted(run_phases(fit), key=lambda p: -float(p.amplitude.mean()))[:most]
    top = max((float(p.amplitude.max()) for p in found), default=1.0)
    unit = fit_error_unit(fit, errors_in)
    polar: Any = new_axes(ax, polar=True)
    for i, order in enumerate(sorted(found, key=lambda p: p.order)):
        colour = palette.run_colour(i)
        marker = palette.run_marker(i)
        polar.plot(
            order.phase,
            unit.per_arcsec * order.amplitude,
            linestyle="none",
            marker=marker,
            markersize=5.0,
            alpha=0.85,
            color=colour,
            label=f"order {order.order:g}",
        )
        # From the middle of the cluster to the centre: which phase it represents.
        mean = np.mean(order.amplitude * np.exp(1j * order.phase))
        polar.plot(
            [0.0, np.angle(mean)], [0.0, unit.per_arcsec * abs(mean)], color=colour, linewidth=0.8
        )
    polar.set_rmin(0.0)
    polar.set_rmax(1.1 * unit.per_arcsec * top)
    polar.set_rlabel_position(112.5)
    polar.set_xticks(np.radians(np.arange(0, 360, 45)))
    polar.set_xlabel(f"angle: phase / deg; radius: amplitude / {unit.name}")
    grid(polar)
    if len(polar.get_figure(root=True).axes) > 1:
        # Below, where no neighbour of a row of axes is.
        polar.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.16),
            ncols=3,
            frameon=False,
            fontsize="x-small",
        )
    else:
        polar.legend(loc="center left", bbox_to_anchor=(1.08, 0.5), frameon=False, fontsize="small")
    drawn: Axes = polar
    told = ", ".join(f"order {p.order:g}" for p in sorted(found, key=lambda p: p.order))
    return described(drawn, f"Phase and amplitude of {told} in every run, on polar axes.", _TITLE)


def draw_phase_of_order(ax: Axes, order: Phases, numbers: dict[str, int], unit: ErrorUnit) -> None:
    """Phase of one order in every run: a level line of dots is a systematic error."""
    mean = np.angle(np.mean(order.amplitude * np.exp(1j * order.phase)))
    around = np.degrees(np.angle(np.exp(1j * (order.phase - mean))))
    middle = float(np.degrees(mean)) % 360.0
    # Half of what a chart of one order shows, degrees, at least: nothing is made to look like
    # scatter.
    half = min(max(1.3 * float(np.abs(around).max()), 15.0), 190.0)
    for place, label in enumerate(order.labels):
        number = numbers[label]
        phase = middle + around[place]
        (dot,) = ax.plot(
            [place + 1.0], [phase], linestyle="none", markersize=6.0,
            color=palette.run_colour(number), marker=palette.run_marker(number),
        )  # fmt: skip
        size = unit.text(float(order.amplitude[place]))
        marked(dot, run=number, titles=[f"run {label}: {size} at {phase:.1f}°"])
    ax.set_xlim(0.3, len(order.labels) + 0.7)
    ax.set_ylim(middle - half, middle + half)
    ax.locator_params(axis="x", integer=True)
    ax.set_xlabel("run")
    ax.set_ylabel("phase / deg")
