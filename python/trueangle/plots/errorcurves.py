"""Error curves of all runs with the model and its confidence band."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..fitting.summary import fit_error_unit
from ..support.display_units import ErrorsIn
from .canvas import new_axes
from .drawnpanel import draw_panel, finish
from .readingpictures import errors_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

__all__ = ["error_curves"]


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
    picture = errors_picture(fit.runs, fit, fit_error_unit(fit, errors_in))
    ax = new_axes(ax)
    draw_panel(ax, picture.panels[0])
    return finish(ax, picture)
