"""Error before and after correction on runs that the model has not seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import new_axes
from .curves import held_out_points, rms_amplitude, seen_span
from .drawnpanel import draw_panel, finish
from .readingpictures import before_after_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..model.model import HarmonicModel

__all__ = ["before_after"]


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
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

    Returns
    -------
    matplotlib Axes
    """
    pairs = held_out_points(model, as_runs(runs))
    unit = error_unit(errors_in, rms_amplitude(before for before, _ in pairs), model.period)
    numbered = [(number, *pair) for number, pair in enumerate(pairs)]
    picture = before_after_picture(numbered, seen_span(model), unit)
    ax = new_axes(ax)
    draw_panel(ax, picture.panels[0])
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    return finish(ax, picture)
