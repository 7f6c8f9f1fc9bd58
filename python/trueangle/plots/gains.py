"""Gain of every finding of a diagnosis on held-out runs, with its interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from . import palette
from .canvas import described, new_axes
from .simulatedcurves import gain_bars

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..diagnosis import Diagnosis

__all__ = ["gains"]


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
        raise ArgumentError("no finding of this diagnosis has a gain that carries over to new runs")
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
