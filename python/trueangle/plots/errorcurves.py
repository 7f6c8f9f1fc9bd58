"""Error curves of all runs with the model and its confidence band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..support.display_units import ErrorsIn, error_unit, significant
from . import palette
from .canvas import described, legend, new_axes, turn_axis
from .curves import (
    CONFIDENCE,
    envelope,
    error_points,
    greatest,
    model_curve,
    seen_span,
    strong_gear_order,
    thinned,
)

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
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where one
        reaches a degree.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    measured = error_points(fit)
    unit = error_unit(errors_in, greatest(measured), fit.model.period)
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
    dense = strong_gear_order(fit.orders, fit.amplitudes, high - low) is not None
    if dense:
        ax.fill_between(
            *envelope(curve),
            color=palette.MUTED,
            alpha=0.35,
            linewidth=0.0,
            zorder=0.5,
            label="envelope of the model",
        )
    else:
        ax.plot(curve.angle, curve.error, color=palette.ink(ax), zorder=3.0, label="model")
    if curve.std is not None and not dense:
        half = CONFIDENCE * curve.std
        ax.fill_between(
            curve.angle,
            curve.error - half,
            curve.error + half,
            color=palette.ink(ax),
            alpha=0.2,
            linewidth=0.0,
            zorder=0.5,
            label="95 % band",
        )
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
