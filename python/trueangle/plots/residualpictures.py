"""Residuals against angle, time, speed, temperature, torque or direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..fitting.summary import unit_of
from ..support.display_units import ErrorsIn, significant
from . import palette
from .canvas import described, grid, legend, new_axes, turn_axis
from .curves import SIGNALS, Points, Signal, residual_points, seen_span, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

__all__ = ["residuals"]

_MOST = 4000
#: Readings that make a running median worth its line.
_BINS, _ENOUGH = 36, 360


def residuals(
    fit: FitResult,
    against: Signal = "angle",
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """What the model leaves of every reading, against a signal that it may depend on.

    The black line joins medians of bins: anything but a flat line at zero is an error
    that the model does not hold. ``"direction"`` gives one box per direction of travel.

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
    found = residual_points(fit, against)
    unit = unit_of(fit, errors_in)
    points = [part.scaled(unit.per_arcsec) for part in found]
    ax = new_axes(ax, height=3.4)
    if against == "direction":
        _boxes(ax, points)
    else:
        for number, whole in enumerate(points):
            part = thinned(whole, _MOST)
            ax.plot(
                part.x,
                part.y,
                linestyle="none",
                marker=palette.run_marker(number),
                markersize=3.5 if part.x.size < 500 else 2.0,
                alpha=0.75 if part.x.size < 500 else 0.35,
                markeredgewidth=0.0,
                color=palette.run_colour(number),
                label=f"run {part.label}",
            )
        _medians(ax, points)
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    grid(ax)
    if against == "angle":
        turn_axis(ax, *seen_span(fit.model))
    ax.set_xlabel(SIGNALS[against])
    ax.set_ylabel(f"residual / {unit.name}")
    legend(ax)
    rest = np.concatenate([part.y for part in points])
    return described(
        ax,
        f"What the model leaves of {rest.size} readings against {against}: "
        f"{significant(float(rest.std()), 3)} {unit.name} standard deviation.",
    )


def _medians(ax: Axes, points: list[Points]) -> None:
    x = np.concatenate([p.x for p in points])
    y = np.concatenate([p.y for p in points])
    low, high = float(x.min()), float(x.max())
    if x.size < _ENOUGH or high <= low:
        return
    edges = np.linspace(low, high, _BINS + 1)
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    filled = [b for b in range(_BINS) if np.count_nonzero(index == b) >= _ENOUGH // _BINS // 2]
    ax.plot(
        [float(x[index == b].mean()) for b in filled],
        [float(np.median(y[index == b])) for b in filled],
        color=palette.ink(ax),
        linewidth=1.4,
        marker=".",
        label="median",
    )


def _boxes(ax: Axes, points: list[Points]) -> None:
    x = np.concatenate([p.x for p in points])
    y = np.concatenate([p.y for p in points])
    names = {-1.0: "backward", 0.0: "at rest", 1.0: "forward"}
    present = [d for d in names if np.any(x == d)]
    ax.boxplot(
        [y[x == d] for d in present],
        tick_labels=[f"{names[d]}\n{np.count_nonzero(x == d)} readings" for d in present],
        widths=0.5,
        flierprops={"marker": ".", "markersize": 3, "markeredgecolor": palette.MUTED},
        medianprops={"color": palette.WARNING, "linewidth": 2},
    )
