"""Measured error against what a simulation of the joint expects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..runs import CalibrationRun, as_runs
from . import palette
from .canvas import legend, new_axes, turn_axis
from .curves import thinned
from .simulatedcurves import simulated_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..simulation import Simulation

__all__ = ["measured_and_simulated"]

_MOST = 6000


def measured_and_simulated(
    runs: CalibrationRun | Iterable[CalibrationRun], sim: Simulation, ax: Axes | None = None
) -> Axes:
    """Measured error, the simulated one at the same readings, and their difference.

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    sim : Simulation
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    found = as_runs(runs)
    ax = new_axes(ax)
    for number, (measured, simulated) in enumerate(simulated_points(found, sim)):
        most = max(1, _MOST // len(found))
        m, s = thinned(measured, most), thinned(simulated, most)
        for x, y, colour, size, name in (
            (m.x, m.y, palette.BEFORE, 3.0, "measured"),
            (s.x, s.y, palette.MODEL, 2.0, "simulated"),
            (m.x, m.y - s.y, palette.AFTER, 3.0, "difference"),
        ):
            ax.plot(
                x,
                y,
                linestyle="none",
                marker="o",
                markersize=size,
                markeredgewidth=0.0,
                alpha=0.6,
                color=colour,
                label=None if number else name,
            )
    turn_axis(ax)
    ax.set_xlabel("reference angle / deg")
    ax.set_ylabel("error / arcsec")
    legend(ax)
    return ax
