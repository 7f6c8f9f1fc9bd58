"""The error that a model takes off, over the angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..support.display_units import ErrorsIn, error_unit, significant_digits, sine_of_rms
from ..support.layout import counted
from .canvas import described, legend, new_axes, turn_axis
from .curves import fitted_degrees, model_curve, strong_gear_order
from .drawnreadings import draw_panel_curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..model.model import HarmonicModel


def model_error(model: HarmonicModel, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Error of a model over the angle, less its constant, with its 95 % band.

    What depends on more than the angle (backlash, lag and other terms) is named in the text
    alternative and not drawn; gear orders, which would fill the picture, are drawn as envelope.

    Parameters
    ----------
    model : HarmonicModel
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

    Examples
    --------
    >>> import trueangle as ta
    >>> model = ta.HarmonicModel((ta.Shaft("output", 1.0, (2,), (0.01,), (0.0,)),), period=360.0)
    >>> ta.plots.text_alternative(model.plot())
    'Error of the model over the angle: 72.0 arcsec peak-to-peak in 1 order.'
    """
    ax = new_axes(ax)
    pattern = model.replace(terms=())
    curve = model_curve(pattern)
    unit = error_unit(errors_in, sine_of_rms(float(np.std(curve.error))), model.period)
    curve = curve.scaled(unit.per_arcsec)
    low, high = fitted_degrees(model)
    dense = strong_gear_order(pattern.orders, pattern.amplitudes, high - low) is not None
    draw_panel_curve(ax, curve, dense)
    turn_axis(ax, low, high)
    ax.set_xlabel(f"{model.argument} angle / deg")
    ax.set_ylabel(f"error / {unit.name}")
    legend(ax)
    terms = ", ".join(term.kind for term in model.terms)
    return described(
        ax,
        f"Error of the model over the angle: {significant_digits(float(np.ptp(curve.error)), 3)} "
        f"{unit.name} peak-to-peak in {counted(len(model.orders), 'order')}"
        + (f"; not drawn: {terms}" if terms else "")
        + ".",
        "Error of the model",
    )
