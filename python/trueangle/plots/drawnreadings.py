"""Pictures of readings: errors of all runs, before and after, residuals, beside a simulation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..fitting.summary import fit_error_unit
from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import described, legend, new_axes
from .curves import Points, Signal, fitted_degrees, held_out_points, rms_amplitude
from .drawnpanel import draw_clouds, draw_panel
from .panel import PanelPicture
from .readingpictures import (
    before_after_picture,
    comparison_picture,
    errors_picture,
    residual_picture,
)
from .simulatedcurves import simulated_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult
    from ..model.model import HarmonicModel
    from ..simulation import Simulation


def error_curves(fit: FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Measured error of every run, the fitted model and its 95 % band.

    Every run is shown less its own zero, the model without its constant; gear orders, which
    would fill the picture, as the envelope of the model.

    Parameters
    ----------
    fit : FitResult
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    picture = errors_picture(fit.runs, fit, fit_error_unit(fit, errors_in))
    ax = new_axes(ax)
    draw_panel(ax, picture.panels[0])
    return _finished(ax, picture, "Measured error of every run, and the model")


def before_after(
    model: HarmonicModel,
    runs: CalibrationRun | Iterable[CalibrationRun],
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Error of held-out ``runs`` before and after correction by ``model``.

    Every run keeps its own zero: the mean of what is left is taken off. The legend gives
    root mean square and peak-to-peak of both.

    Parameters
    ----------
    model : HarmonicModel
    runs : CalibrationRun or iterable of them
        That took no part in the fit; runs that did make the picture too good.
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes
    """
    pairs = held_out_points(model, as_runs(runs))
    unit = error_unit(errors_in, rms_amplitude(before for before, _ in pairs), model.period)
    numbered = [(number, *pair) for number, pair in enumerate(pairs)]
    picture = before_after_picture(numbered, fitted_degrees(model), unit)
    ax = new_axes(ax)
    draw_panel(ax, picture.panels[0])
    return _finished(ax, picture, "Held-out runs before and after correction")


def residuals(
    fit: FitResult,
    against: Signal = "angle",
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """What the model leaves of every reading, against a signal that it may depend on.

    The black line joins medians of bins: anything but a flat line at zero is an error
    that the model does not hold. For ``"direction"`` the runs stand next to each other.

    Parameters
    ----------
    fit : FitResult
    against : {"angle", "time", "speed", "temperature", "direction", "torque"}
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        An unknown signal, or one that no run has.
    """
    picture = residual_picture(fit, against, fit_error_unit(fit, errors_in))
    ax = new_axes(ax, height=3.4)
    draw_panel(ax, picture.panels[0])
    return _finished(ax, picture, f"Residual against {against}")


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
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

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
    return _finished(ax, picture, "Measured and simulated error")


def _finished(ax: Axes, picture: PanelPicture, title: str) -> Axes:
    """With the legend, the sentence and the title of a picture."""
    legend(ax)
    return described(ax, picture.told, title)
