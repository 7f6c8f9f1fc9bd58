"""Certified errors with their expanded uncertainties over the angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..support.display_units import ErrorsIn, error_unit, significant, sine_of_rms
from . import palette
from .canvas import described, new_axes, new_figure, turn_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["certified_errors", "certified_pair"]


def certified_errors(
    positions: Sequence[Mapping[str, float]],
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Error at every nominal position with bars of its expanded uncertainty.

    Parameters
    ----------
    positions : sequence of mappings
        ``angle_deg, error_arcsec, expanded_arcsec``, as a certificate's content has them.
    ax : matplotlib Axes, optional
    errors_in : str or float
        Unit of the errors, as for summaries: ``"auto"`` is arcsec, or degrees where they
        are that large.

    Returns
    -------
    matplotlib Axes
    """
    ax = new_axes(ax, height=2.8)
    angle, error, expanded = (
        np.array([row[name] for row in positions])
        for name in ("angle_deg", "error_arcsec", "expanded_arcsec")
    )
    unit = error_unit(errors_in, sine_of_rms(float(np.std(error))))
    error, expanded = unit.per_arcsec * error, unit.per_arcsec * expanded
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8)
    ax.errorbar(
        angle,
        error,
        yerr=expanded,
        linestyle="none",
        marker="o",
        markersize=3.0,
        color=palette.AFTER,
        ecolor=palette.ink(ax),
        elinewidth=0.9,
        capsize=2.0,
    )
    margin = 0.02 * max(float(np.ptp(angle)), 1.0)
    turn_axis(ax, float(angle.min()) - margin, float(angle.max()) + margin)
    ax.set_xlabel("position / deg")
    ax.set_ylabel(f"error / {unit.name}")
    return described(
        ax,
        f"Error at {len(positions)} positions with expanded uncertainty, from "
        f"{significant(float(error.min()))} to {significant(float(error.max()))} {unit.name}, "
        f"U at most {significant(float(expanded.max()), 2)} {unit.name}.",
    )


def certified_pair(
    positions: Sequence[Mapping[str, float]],
    below: Sequence[Mapping[str, float]],
    errors_in: ErrorsIn = "auto",
) -> list[Axes]:
    """`certified_errors` of two, one below the other, each at a scale of its own.

    Parameters
    ----------
    positions, below : sequence of mappings
    errors_in : str or float

    Returns
    -------
    list of two matplotlib Axes
    """
    figure, axes = new_figure(2, 1, 7.5, 4.6, sharey=False)
    for ax, rows in zip(axes, (positions, below), strict=True):
        certified_errors(rows, ax=ax, errors_in=errors_in)
    axes[0].set_xlabel("")
    figure.align_ylabels()
    return axes
