"""A fleet in pictures: phasors of an order, patterns, sizes with their limit, all at a glance."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..errors import ArgumentError
from ..support.angles import arcsec
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import counted
from ..support.suggestions import check_choice
from . import palette
from .canvas import described, grid, legend, marked, new_axes, new_figure, turn_axis
from .controlcharts import fleet_history

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fleets.result import CommonOrder, Fleet, FleetUnit, UnitOrder

#: Radius that holds 95 % of a plane normal distribution, in standard deviations of a coordinate.
RADIUS_OF_95: Final = math.sqrt(-2.0 * math.log(0.05))


#: Units whose patterns are plotted at most, those that need attention first, and in a row.
_PATTERNS: Final = 20
_IN_A_ROW: Final = 5

#: Verdicts in two kinds: their names, colours and marks.
_VERDICTS: Final = (("fine", palette.AFTER, "o"), ("not fine", palette.WARNING, "D"))


def _of_kind(fleet: Fleet, kind: str) -> list[FleetUnit]:
    return [unit for unit in fleet.units if (unit.verdict == "fine") == (kind == "fine")]


def _shown(fleet: Fleet, largest: float, errors_in: ErrorsIn) -> tuple[ErrorUnit, float]:
    """The unit of the errors, and what turns the fleet's unit into it."""
    scale = arcsec(1.0, fleet.period)
    shown = error_unit(errors_in, scale * largest, fleet.period)
    return shown, scale * shown.per_arcsec


def fleet_phasors(
    fleet: Fleet, order: float | None = None, ax: Axes | None = None, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Phase and amplitude of one order of every unit, and the circle that holds 95 % of a fleet.

    Parameters
    ----------
    fleet : Fleet
    order : float, optional
        Default: the order in which the units differ most.
    ax : matplotlib PolarAxes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float

    Returns
    -------
    matplotlib PolarAxes

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
    largest = max(unit.orders[at].amplitude for unit in fleet.units)
    shown, size = _shown(fleet, largest, errors_in)
    polar: Any = new_axes(ax, polar=True)
    turn = np.linspace(0.0, 2.0 * math.pi, 361)
    circle = complex(common.sine, common.cosine) + RADIUS_OF_95 * between.std * np.exp(1j * turn)
    polar.plot(
        np.angle(circle),
        size * np.abs(circle),
        color=palette.MUTED,
        linestyle="--",
        label="95 % of units",
    )
    for kind, colour, marker in _VERDICTS:
        units = _of_kind(fleet, kind)
        phase = np.radians([unit.orders[at].phase_deg for unit in units])
        amplitude = size * np.array([unit.orders[at].amplitude for unit in units])
        if units:
            polar.plot(
                phase, amplitude, linestyle="none", marker=marker, markersize=5.0, color=colour,
                label=kind,
            )  # fmt: skip
        if kind != "fine":
            for unit, a, b in zip(units, phase, amplitude, strict=True):
                polar.annotate(unit.unit, (a, b), xytext=(5, 5), textcoords="offset points")
    polar.set_rmin(0.0)
    polar.set_rmax(1.1 * size * max(largest, float(np.abs(circle).max())))
    polar.set_rlabel_position(112.5)
    polar.set_title(f"order {order:g}: phase, amplitude / {shown.name}", fontsize="medium")
    grid(polar)
    if ax is None:
        polar.legend(loc="upper left", bbox_to_anchor=(-0.18, 1.0), frameon=False, fontsize="small")
    odd = [unit.unit for unit in _of_kind(fleet, "not fine")]
    return described(
        polar,
        f"Order {order:g} of {len(fleet.units)} units as phasors, with the circle that holds 95 % "
        "of them" + (f"; not fine: {', '.join(odd[:8])}." if odd else "; all are fine."),
    )


def fleet_sizes(fleet: Fleet, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Peak-to-peak of every unit, sorted, and the band that holds a share of all further ones.

    Parameters
    ----------
    fleet : Fleet
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float

    Returns
    -------
    matplotlib Axes
    """
    shown, size = _shown(fleet, max(unit.peak_to_peak for unit in fleet.units), errors_in)
    ax = new_axes(ax)
    bound = fleet.tolerance
    ranked = sorted(fleet.units, key=lambda unit: unit.peak_to_peak)
    if math.isfinite(bound.peak_to_peak):
        label = f"{100 * bound.share:g} % of units, {100 * bound.confidence:g} % confidence"
        ax.axhspan(0.0, size * bound.peak_to_peak, color=palette.MUTED, alpha=0.18, label=label)
    for kind, colour, marker in _VERDICTS:
        rows = [
            (i, u) for i, u in enumerate(ranked, 1) if (u.verdict == "fine") == (kind == "fine")
        ]
        if rows:
            ax.plot(
                [i for i, _ in rows], [size * u.peak_to_peak for _, u in rows], linestyle="none",
                marker=marker, markersize=5.0, color=colour, label=kind,
            )  # fmt: skip
        for i, unit in rows if kind != "fine" else []:
            ax.annotate(
                unit.unit, (i, size * unit.peak_to_peak), xytext=(-6, 4),
                textcoords="offset points", ha="right",
            )  # fmt: skip
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("units by size")
    ax.set_ylabel(f"peak-to-peak / {shown.name}")
    grid(ax, "y")
    legend(ax)
    band = " and the band that holds the fleet" if math.isfinite(bound.peak_to_peak) else ""
    return described(ax, f"Peak-to-peak of {counted(ranked, 'unit')}{band}.", "Size of every unit")


def fleet_patterns(fleet: Fleet, errors_in: ErrorsIn = "auto", most: int = _PATTERNS) -> Axes:
    """The error over a turn of each unit in separate axes, on one scale, the urgent first.

    Parameters
    ----------
    fleet : Fleet
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
    most : int
        Units that are plotted.

    Returns
    -------
    matplotlib Axes
        The first of a new figure's.
    """
    units = fleet.units[: max(most, 1)]
    shown, size = _shown(fleet, max(unit.peak_to_peak for unit in units), errors_in)
    rows = -(-len(units) // _IN_A_ROW)
    columns = min(len(units), _IN_A_ROW)
    figure, axes = new_figure(rows, columns, 2.1 * columns + 0.6, 1.6 * rows + 0.6)
    for i, ax in enumerate(axes):
        if i >= len(units):
            ax.set_visible(False)
            continue
        unit = units[i]
        draw_pattern(ax, fleet, unit, size)
        ax.set_xticks([0.0, 180.0, 360.0], ["", "", ""])
        if i + columns >= len(units):
            ax.set_xticks([0.0, 180.0, 360.0], ["0", "180", "360"])
        fine = unit.verdict == "fine"
        title = unit.unit if fine else f"{unit.unit}: {unit.verdict.replace('_', ' ')}"
        ax.set_title(title, fontsize="small")
    figure.supxlabel("true angle / deg", fontsize="medium")
    figure.supylabel(f"error / {shown.name}", fontsize="medium")
    return described(
        axes[0],
        f"Error over a turn of {len(units)} of {len(fleet.units)} units, those that need attention "
        "first, and the pattern that all share.",
    )


def draw_pattern(ax: Axes, fleet: Fleet, unit: FleetUnit, size: float) -> None:
    """The error of a unit over a turn, and behind it what all share."""
    highest = max(fleet.orders, default=1.0)
    angle = np.linspace(0.0, 360.0, max(361, math.ceil(8.0 * highest) + 1))
    fine = unit.verdict == "fine"
    ax.plot(angle, size * turn_pattern(fleet.common, angle), color=palette.MUTED, linewidth=0.9)
    ax.plot(
        angle,
        size * turn_pattern(unit.orders, angle),
        color=palette.AFTER if fine else palette.WARNING,
    )
    turn_axis(ax, 0.0, 360.0)


def draw_phasor_plane(ax: Axes, fleet: Fleet, at: int, size: float) -> None:
    """Cosine and sine of one order of every unit, and the circle that holds 95 % of them."""
    common, between = fleet.common[at], fleet.between[at]
    turn = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 91))
    circle = size * (common.cosine + 1j * common.sine + RADIUS_OF_95 * between.std * turn)
    ax.plot(
        circle.real, circle.imag, color=palette.MUTED, linestyle="--", label="95 % of units"
    )  # fmt: skip
    reach = float(np.abs([circle.real, circle.imag]).max())
    for kind, colour, marker in _VERDICTS:
        units = _of_kind(fleet, kind)
        phase = np.radians([unit.orders[at].phase_deg for unit in units])
        amplitude = size * np.array([unit.orders[at].amplitude for unit in units])
        if units:
            (dots,) = ax.plot(
                amplitude * np.sin(phase), amplitude * np.cos(phase), linestyle="none",
                marker=marker, markersize=5.0, color=colour, label=kind,
            )  # fmt: skip
            marked(dots, titles=[unit.unit for unit in units])
            reach = max(reach, float(amplitude.max()))
    reach = 1.1 * reach or 1.0
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    grid(ax)


def fleet_overview(fleet: Fleet, errors_in: ErrorsIn = "auto") -> Axes:
    """Phasors of the orders in which the units differ most, and sizes with the tolerance band.

    Parameters
    ----------
    fleet : Fleet
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float

    Returns
    -------
    matplotlib Axes
        The first of a new figure's: the sizes.
    """
    # Orders whose phasors an overview has.
    spread = np.argsort([-row.std for row in fleet.between], kind="stable")[:3]
    figure, (placeholder,) = new_figure(1, 1, 3.6 * len(spread), 7.2)
    placeholder.remove()
    layout = figure.add_gridspec(2, len(spread))
    sizes = figure.add_subplot(layout[0, :])
    fleet_sizes(fleet, ax=sizes, errors_in=errors_in)
    for column, at in enumerate(spread):
        polar: Any = figure.add_subplot(layout[1, column], projection="polar")
        polar.tick_params(labelsize="small")
        fleet_phasors(fleet, fleet.orders[int(at)], ax=polar, errors_in=errors_in)
    odd = [unit.unit for unit in fleet.units if unit.verdict != "fine"]
    return described(
        sizes,
        f"Sizes of {len(fleet.units)} units and phasors of the orders in which they differ most; "
        + (f"not fine: {', '.join(odd[:8])}." if odd else "all are fine."),
    )


_KINDS: dict[str, Any] = {
    "overview": fleet_overview,
    "patterns": fleet_patterns,
    "phasors": fleet_phasors,
    "sizes": fleet_sizes,
    "history": fleet_history,
}


def fleet_plot(fleet: Fleet, kind: str = "overview", **options: Any) -> Axes:
    """See `trueangle.Fleet.plot`."""
    axes: Axes = _KINDS[check_choice("kind", kind, _KINDS)](fleet, **options)
    return axes


def turn_pattern(orders: Iterable[UnitOrder | CommonOrder], angle: Array) -> Array:
    """The sum of a unit's orders, or of those that all share, over the angle in degrees."""
    found = np.zeros_like(angle)
    for row in orders:
        found += row.amplitude * np.sin(np.radians(row.order * angle + row.phase_deg))
    return found
