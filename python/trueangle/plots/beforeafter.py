"""Error before and after correction on runs that the model has not seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit, significant
from . import palette
from .canvas import described, legend, new_axes, turn_axis
from .curves import held_out_points, seen_span, strength, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..model.model import HarmonicModel

__all__ = ["before_after"]

_MOST = 8000


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
    unit = error_unit(errors_in, strength(before for before, _ in pairs), model.period)
    ax = new_axes(ax)
    told: list[str] = []
    for points, colour, name, marker in (
        ([b.scaled(unit.per_arcsec) for b, _ in pairs], palette.BEFORE, "before", "s"),
        ([a.scaled(unit.per_arcsec) for _, a in pairs], palette.AFTER, "after", "o"),
    ):
        y = np.concatenate([p.y for p in points])
        rms, ptp = float(np.sqrt(np.mean(y * y))), float(np.ptp(y))
        for i, part in enumerate(thinned(p, max(1, _MOST // len(points))) for p in points):
            ax.plot(
                part.x,
                part.y,
                linestyle="none",
                marker=marker,
                markersize=3.0 if y.size < 2000 else 1.5,
                alpha=0.8 if y.size < 2000 else 0.4,
                markeredgewidth=0.0,
                color=colour,
                label=None
                if i
                else f"{name}: rms {significant(rms)}, peak-to-peak {significant(ptp)} {unit.name}",
            )
        told.append(
            f"{name} correction rms {significant(rms)}, peak-to-peak {significant(ptp)} {unit.name}"
        )
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    turn_axis(ax, *seen_span(model))
    ax.set_xlabel("reference angle / deg")
    ax.set_ylabel(f"error of held-out runs / {unit.name}")
    legend(ax)
    return described(ax, f"Error of {len(pairs)} held-out runs: {'; '.join(told)}.")
