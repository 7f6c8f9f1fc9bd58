"""Seconds of a piece of work over its size, with the model of cost beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from . import palette
from .canvas import described, grid, legend, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["cost_curves"]


def cost_curves(
    measured: Mapping[str, Sequence[tuple[float, float]]],
    models: Mapping[str, tuple[float, float]],
    ax: Axes | None = None,
    *,
    size: str = "readings",
) -> Axes:
    """Medians as dots, models ``t₀ + n t₁`` as lines, both axes logarithmic.

    Parameters
    ----------
    measured : mapping of label to pairs
        Size and seconds.
    models : mapping of label to (float, float)
        Seconds of a call, and of one reading, for labels among those of ``measured``.
    ax : matplotlib Axes, optional
    size : str
        What is counted, for the axis.

    Returns
    -------
    matplotlib Axes
    """
    ax = new_axes(ax, height=4.5)
    for number, (label, points) in enumerate(measured.items()):
        n, seconds = np.array(points, dtype=np.float64).T
        colour = palette.RUNS[number % len(palette.RUNS)]
        marker = palette.MARKERS[number % len(palette.MARKERS)]
        ax.plot(n, seconds, marker, color=colour, markersize=5.0, label=label)
        if label in models:
            call, each = models[label]
            over = np.geomspace(n.min(), n.max(), 100)
            ax.plot(over, call + each * over, color=colour, linewidth=1.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel(size)
    ax.set_ylabel("seconds: medians, and the model of cost")
    grid(ax)
    legend(ax)
    told = "; ".join(
        f"{label}: " + ", ".join(f"{x:.0e} in {t:.2g} s" for x, t in points)
        for label, points in measured.items()
    )
    return described(ax, f"Seconds over {size}: {told}.")
