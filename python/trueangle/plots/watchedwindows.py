"""The windows of a watched joint: its charts with their limit, and what each order is off by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..errors import ArgumentError
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, error_unit
from . import palette
from .canvas import described, grid, legend, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..monitoring.alarm import WatchedWindow

__all__ = ["watched_windows"]

#: Orders that are drawn at most: those whose sums rose highest.
_MOST: Final = 6


def watched_windows(
    windows: Sequence[WatchedWindow], period: float, errors_in: ErrorsIn = "auto"
) -> Axes:
    """Cumulative sums over the windows with their limit and alarms, and each order less the model.

    Parameters
    ----------
    windows : sequence of WatchedWindow
        Every window of a `trueangle.Monitor` (its ``windows_of``).
    period : float
        Of the model.
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float

    Returns
    -------
    matplotlib Axes
        The upper of a new figure's two.

    Raises
    ------
    ArgumentError
        No windows.
    """
    if not windows:
        raise ArgumentError("windows is empty: no window of travel has ended")
    number = np.array([window.window for window in windows])
    sums = np.array([[row.statistic for row in window.orders] for window in windows])
    size = np.array([[row.amplitude for row in window.orders] for window in windows])
    scale = arcsec(1.0, period)
    shown = error_unit(errors_in, scale * float(size.max()), period)
    figure, (upper, lower) = new_figure(2, 1, 7.5, 6.0, sharey=False)
    drawn = np.sort(np.argsort(-sums.max(axis=0), kind="stable")[:_MOST])
    for k in drawn:
        look: dict[str, Any] = {"color": palette.run_colour(int(k)), "linewidth": 1.2}
        order = f"order {windows[0].orders[k].order:g}"
        upper.plot(number, sums[:, k], label=order, **look)
        lower.plot(number, scale * shown.per_arcsec * size[:, k], label=order, **look)
    limit = windows[-1].limit
    upper.axhline(limit, color=palette.ink(upper), linestyle="--", linewidth=1.0, label="limit")
    alarms = [window for window in windows if window.alarm]
    if alarms:
        upper.plot(
            [window.window for window in alarms],
            [window.statistic for window in alarms],
            linestyle="none",
            marker="D",
            color=palette.WARNING,
            label="alarm",
        )
    upper.set_ylabel("cumulative sum")
    lower.set_ylabel(f"less the model / {shown.name}")
    lower.set_xlabel("window")
    for ax in (upper, lower):
        ax.set_xlim(number[0] - 0.5, number[-1] + 0.5)
        ax.set_ylim(bottom=0.0)
        grid(ax)
    legend(upper)
    figure.align_ylabels()
    first = f"; the first in window {alarms[0].window}: {alarms[0].because}" if alarms else ""
    return described(
        upper,
        f"Charts of {len(windows)} windows of a watched joint with their limit, {len(alarms)} "
        f"alarm{'s' * (len(alarms) != 1)}{first}.",
    )
