"""Measured error against what a simulation of the joint expects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit, significant
from . import palette
from .canvas import described, legend, new_axes, turn_axis
from .curves import strength, thinned
from .simulatedcurves import simulated_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..simulation import Simulation

__all__ = ["measured_and_simulated"]

_MOST = 6000


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
    largest = strength(measured for measured, _ in expected)
    unit = error_unit(errors_in, largest, found[0].period)
    pairs = [(m.scaled(unit.per_arcsec), s.scaled(unit.per_arcsec)) for m, s in expected]
    # The difference stands below the two, on a line of its own: nothing hides another.
    rest = np.concatenate([m.y - s.y for m, s in pairs])
    lowest = min(float(points.y.min()) for pair in pairs for points in pair)
    down = lowest - 1.15 * float(rest.max()) - 0.05 * float(np.ptp(rest))
    for number, (measured, simulated) in enumerate(pairs):
        most = max(1, _MOST // len(found))
        m, s = thinned(measured, most), thinned(simulated, most)
        for x, y, colour, marker, size, name in (
            (m.x, m.y, palette.BEFORE, "o", 4.0, "measured"),
            (s.x, s.y, palette.ink(ax), ".", 2.5, "simulated"),
            (m.x, m.y - s.y + down, palette.AFTER, "s", 2.5, "difference, moved down"),
        ):
            hollow = name == "measured"
            ax.plot(
                x,
                y,
                linestyle="none",
                marker=marker,
                markersize=size,
                markeredgewidth=0.7 if hollow else 0.0,
                markerfacecolor="none" if hollow else colour,
                color=colour,
                label=None if number else name,
            )
    ax.axhline(down, color=palette.MUTED, linewidth=0.8, zorder=0)
    turn_axis(ax)
    # Numbers of the axis belong to the two above; below them stands the difference's zero.
    top = max(float(points.y.max()) for pair in pairs for points in pair)
    ticks = [float(tick) for tick in ax.get_yticks() if lowest <= tick <= top]
    texts = [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks]
    ax.set_yticks([down, *ticks], ["0", *texts])
    ax.set_xlabel("reference angle / deg")
    ax.set_ylabel(f"error / {unit.name}")
    legend(ax)
    return described(
        ax,
        f"Measured and simulated error of {len(found)} runs over the angle; they differ by "
        f"{significant(float(rest.std()), 3)} {unit.name} rms.",
    )
