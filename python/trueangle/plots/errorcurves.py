"""Error curves of all runs with the model and its confidence band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..fitting.summary import unit_of
from ..support.display_units import ErrorsIn, significant
from . import palette
from .canvas import described, legend, new_axes, turn_axis
from .curves import error_points, model_curve, seen_span, thinned
from .modelerror import draw_curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

__all__ = ["error_curves"]

#: Points drawn per run; a picture is no wider.
_MOST = 4000


def error_curves(fit: FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Measured error of every run, the fitted model and its 95 % band.

    Every run is shown less its own zero, the model without its constant; gear orders, which
    would fill the picture, as the envelope of the model.

    Parameters
    ----------
    fit : FitResult
    ax : matplotlib Axes, optional
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    measured = error_points(fit)
    unit = unit_of(fit, errors_in)
    ax = new_axes(ax)
    for number, points in enumerate(measured):
        part = thinned(points, _MOST).scaled(unit.per_arcsec)
        ax.plot(
            part.x,
            part.y,
            linestyle="none",
            marker=palette.run_marker(number),
            markersize=2.0 if part.x.size > 500 else 3.5,
            alpha=0.35 if part.x.size > 500 else 0.75,
            markeredgewidth=0.0,
            color=palette.run_colour(number),
            label=f"run {part.label}",
        )
    curve = model_curve(fit.model).scaled(unit.per_arcsec)
    # A gear's orders fill the picture: the readings stay on top of them.
    low, high = seen_span(fit.model)
    draw_curve(ax, curve, fit.model, high - low)
    turn_axis(ax, low, high)
    ax.set_xlabel("reference angle / deg")
    ax.set_ylabel(f"error, zero of the run removed / {unit.name}")
    legend(ax)
    size = significant(float(np.ptp(curve.error)), 3)
    return described(
        ax,
        f"Error of {len(fit.runs)} runs over the angle and the fitted model, which spans {size} "
        f"{unit.name} peak-to-peak in {len(fit.orders)} orders.",
    )
