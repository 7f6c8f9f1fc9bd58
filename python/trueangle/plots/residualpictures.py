"""Residuals against angle, time, speed, temperature, torque or direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..fitting.summary import fit_error_unit
from ..support.display_units import ErrorsIn
from . import palette
from .canvas import new_axes
from .curves import Signal
from .drawnpanel import draw_panel, finish
from .readingpictures import residual_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

__all__ = ["residuals"]


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
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

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
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    if against == "direction":
        ax.set_xticks([-1.0, 0.0, 1.0], ["backward", "at rest", "forward"])
    return finish(ax, picture)
