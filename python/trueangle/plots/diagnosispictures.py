"""Pictures of a diagnosis: gains of its findings, and what each leaves of held-out readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import described, new_axes
from .simulatedcurves import error_left_of, gain_bars

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..diagnosis import Diagnosis

_NO_GAIN = "no finding of this diagnosis has a gain that carries over to new runs"


def gains(diagnosis: Diagnosis, ax: Axes | None = None) -> Axes:
    """Share of the reducible error that each cause takes away, with 95 % intervals.

    Reducible is what stands above the noise; 100 % leaves noise alone. Causes that are
    drawn anew in each run (a slipped zero) have no such gain and are not drawn.

    Parameters
    ----------
    diagnosis : Diagnosis
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        No finding has a gain to draw.
    """
    bars = gain_bars(diagnosis)
    if not bars:
        raise ArgumentError(_NO_GAIN)
    ax = new_axes(ax, height=1.4 + 0.4 * len(bars))
    place = np.arange(len(bars))
    share = np.array([bar.share for bar in bars])
    below = share - [min(bar.low, bar.share) for bar in bars]
    above = np.array([max(bar.high, bar.share) for bar in bars]) - share
    ax.barh(place, share, height=0.6, color=palette.AFTER)
    ax.errorbar(share, place, xerr=[below, above], fmt="none", ecolor=palette.ink(ax), capsize=4.0)
    ax.axvline(100.0, color=palette.MUTED, linestyle="--", linewidth=1.0)
    ax.set_yticks(place, [bar.cause for bar in bars])
    ax.invert_yaxis()
    ax.set_xlim(min(0.0, float((share - below).min())), max(105.0, float((share + above).max())))
    ax.set_xlabel("share of the reducible error taken away on held-out runs / %")
    told = ", ".join(f"{b.cause} {b.share:.0f} % ({b.low:.0f} to {b.high:.0f})" for b in bars)
    return described(ax, f"Share of the reducible error that each cause takes away: {told}.")


def error_left(diagnosis: Diagnosis, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Rms left of held-out readings: with all causes in place, and with each one left out.

    The numbers are those of the findings' gains, so that they cannot say otherwise.

    Parameters
    ----------
    diagnosis : Diagnosis
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

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
        raise ArgumentError(_NO_GAIN)
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
