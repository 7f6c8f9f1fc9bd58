"""Units of a fleet as phasors of one order, with the circle that holds 95 % of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import described, grid, legend, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fleets.result import Fleet

__all__ = ["fleet_phasors"]

#: Radius that holds 95 % of a plane normal distribution, in standard deviations of a coordinate.
_RADIUS: float = math.sqrt(-2.0 * math.log(0.05))


def fleet_phasors(
    fleet: Fleet, order: float | None = None, ax: Axes | None = None, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Cosine and sine of one order of every unit, and the circle that holds 95 % of a fleet.

    Parameters
    ----------
    fleet : Fleet
    order : float, optional
        Default: the order in which the units differ most.
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        An order that the fleet was not looked at for.
    """
    if order is None:
        order = max(fleet.between, key=lambda row: row.std).order
    if order not in fleet.orders:
        named = ", ".join(f"{k:g}" for k in fleet.orders)
        raise ArgumentError(f"order must be one of {named}, got {order!r}")
    at = fleet.orders.index(order)
    common, between = fleet.common[at], fleet.between[at]
    scale = arcsec(1.0, fleet.period)
    rows = [unit.orders[at] for unit in fleet.units]
    largest = scale * max(row.amplitude for row in rows)
    shown = error_unit(errors_in, largest, fleet.period)
    size = scale * shown.per_arcsec
    ax = new_axes(ax, height=6.0)
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    radius = _RADIUS * between.std
    ax.plot(
        size * (common.cosine + radius * np.cos(turn)),
        size * (common.sine + radius * np.sin(turn)),
        color=palette.MUTED,
        linestyle="--",
        label="95 % of units",
    )
    for verdict, colour, marker in (
        ("fine", palette.AFTER, "o"),
        ("not fine", palette.WARNING, "D"),
    ):
        chosen = [
            (row, unit.unit)
            for row, unit in zip(rows, fleet.units, strict=True)
            if (unit.verdict == "fine") == (verdict == "fine")
        ]
        if not chosen:
            continue
        phases = np.radians([row.phase_deg for row, _ in chosen])
        amplitudes = size * np.array([row.amplitude for row, _ in chosen])
        x, y = amplitudes * np.sin(phases), amplitudes * np.cos(phases)
        ax.plot(x, y, linestyle="none", marker=marker, color=colour, label=verdict)
        if verdict != "fine":
            for (_, name), a, b in zip(chosen, x, y, strict=True):
                ax.annotate(name, (a, b), xytext=(5, 5), textcoords="offset points")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(f"cosine of order {order:g} / {shown.name}")
    ax.set_ylabel(f"sine of order {order:g} / {shown.name}")
    grid(ax)
    legend(ax)
    odd = [unit.unit for unit in fleet.units if unit.verdict != "fine"]
    return described(
        ax,
        f"Order {order:g} of {len(rows)} units as phasors, with the circle that holds 95 % of them"
        + (f"; not fine: {', '.join(odd[:8])}." if odd else "; all are fine."),
    )
