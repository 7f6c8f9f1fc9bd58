"""Measured error against what a simulation of the joint expects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import new_axes
from .curves import Points, rms_amplitude
from .drawnpanel import draw_clouds, draw_panel, finish
from .readingpictures import comparison_picture
from .simulatedcurves import simulated_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..simulation import Simulation

__all__ = ["measured_and_simulated"]


def measured_and_simulated(
    runs: CalibrationRun | Iterable[CalibrationRun],
    sim: Simulation,
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Measured error, the simulated one at the same readings, and their difference.

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    sim : Simulation
    ax : matplotlib Axes, optional
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

    Returns
    -------
    matplotlib Axes
    """
    found = as_runs(runs)
    ax = new_axes(ax)
    expected = simulated_points(found, sim)
    largest = rms_amplitude(measured for measured, _ in expected)
    unit = error_unit(errors_in, largest, found[0].period)
    picture = comparison_picture(expected, unit)
    both, apart = picture.panels
    # The difference stands below the two, on a line of its own: nothing hides another.
    rest = np.concatenate([cloud.points.y for cloud in apart.clouds])
    shown = np.concatenate([cloud.points.y for cloud in both.clouds])
    lowest, top = float(shown.min()), float(shown.max())
    down = lowest - 1.15 * float(rest.max()) - 0.05 * float(np.ptp(rest))
    draw_panel(ax, both)
    moved = [
        replace(
            cloud,
            points=Points(cloud.points.label, cloud.points.x, cloud.points.y + down),
            role="after",
            name="difference, moved down",
        )
        for cloud in apart.clouds
    ]
    draw_clouds(ax, moved)
    ax.axhline(down, color=palette.MUTED, linewidth=0.8, zorder=0)
    # Numbers of the axis belong to the two above; below them stands the difference's zero.
    ticks = [float(tick) for tick in ax.get_yticks() if lowest <= tick <= top]
    texts = [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks]
    ax.set_yticks([down, *ticks], ["0", *texts])
    return finish(ax, picture)
