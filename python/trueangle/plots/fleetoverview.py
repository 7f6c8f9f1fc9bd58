"""A fleet at a glance: phasors of the orders in which units differ most, and their sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..support.display_units import ErrorsIn
from ..support.suggestions import check_choice
from .canvas import described, new_figure
from .fleetpictures import fleet_history, fleet_patterns, fleet_phasors, fleet_sizes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fleets.result import Fleet

__all__ = ["fleet_overview", "fleet_plot"]

#: Orders whose phasors are drawn.
_ORDERS: Final = 3


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
    spread = np.argsort([-row.std for row in fleet.between], kind="stable")[:_ORDERS]
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
