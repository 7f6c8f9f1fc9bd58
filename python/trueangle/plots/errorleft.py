"""What a diagnosis leaves of held-out readings, with all its causes and without each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import described, new_axes
from .simulatedcurves import error_left_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..diagnosis import Diagnosis

__all__ = ["error_left"]


def error_left(diagnosis: Diagnosis, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Rms left of held-out readings: with all causes in place, and with each one left out.

    The numbers are those of the findings' gains, so that they cannot say otherwise.

    Parameters
    ----------
    diagnosis : Diagnosis
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
        No finding has a gain that carries over to new runs.
    """
    left = error_left_of(diagnosis)
    if left is None:
        raise ArgumentError("no finding of this diagnosis has a gain that carries over to new runs")
    names, sizes = zip(*left.rows, strict=True)
    unit = error_unit(errors_in, max(left.noise, *sizes))
    noise = unit.per_arcsec * left.noise
    ax = new_axes(ax, height=1.4 + 0.4 * len(sizes))
    place = list(range(len(sizes)))
    bars = ax.barh(
        place,
        [unit.per_arcsec * rms for rms in sizes],
        height=0.6,
        color=[palette.AFTER] + [palette.BEFORE] * (len(sizes) - 1),
    )
    ax.bar_label(bars, [unit.number(rms) for rms in sizes], padding=3, fontsize="small")
    ax.axvline(noise, color=palette.ink(ax), linestyle="--", linewidth=1.0)
    ax.annotate(
        f"noise {unit.number(left.noise)}",
        (noise, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        fontsize="small",
    )
    ax.set_yticks(place, names)
    ax.invert_yaxis()
    ax.margins(x=0.12)
    ax.set_xlabel(left.axis(unit))
    return described(ax, left.told(unit))
