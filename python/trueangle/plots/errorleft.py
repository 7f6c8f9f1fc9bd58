"""What is left of the disagreement after each cause of a diagnosis is added."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..runs import CalibrationRun, as_runs
from . import palette
from .canvas import new_axes
from .simulatedcurves import left_after_causes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..diagnosis import Diagnosis
    from ..simulation import Simulation

__all__ = ["error_left"]


def error_left(
    diagnosis: Diagnosis,
    runs: CalibrationRun | Iterable[CalibrationRun],
    sim: Simulation,
    ax: Axes | None = None,
) -> Axes:
    """Rms of measured less simulated error as each finding joins, down to the noise.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of ``runs`` against ``sim``.
    runs : CalibrationRun or iterable of them
    sim : Simulation
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    steps = left_after_causes(diagnosis, as_runs(runs), sim)
    ax = new_axes(ax, height=1.4 + 0.4 * len(steps))
    place = list(range(len(steps)))
    bars = ax.barh(
        place,
        [rms for _, rms in steps],
        height=0.6,
        color=[palette.BEFORE] + [palette.AFTER] * (len(steps) - 1),
    )
    ax.bar_label(bars, fmt="%.2f", padding=3, fontsize="small")
    ax.axvline(diagnosis.noise, color=palette.MODEL, linestyle="--", linewidth=1.0)
    ax.annotate(
        f"noise {diagnosis.noise:.2f}",
        (diagnosis.noise, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        fontsize="small",
    )
    ax.set_yticks(place, [name for name, _ in steps])
    ax.invert_yaxis()
    ax.margins(x=0.12)
    ax.set_xlabel("rms of measured less simulated error / arcsec")
    return ax
