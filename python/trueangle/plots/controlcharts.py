"""Control charts: a unit of a fleet over its dates, a running joint over its windows."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..support.angles import arcsec
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, error_unit
from ..support.layout import counted
from ..support.suggestions import check_choice
from . import palette
from .canvas import described, grid, legend, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fleets.result import Fleet
    from ..model.monitor import WatchedWindow


def draw_sums(
    ax: Axes, x: Sequence[Any] | Array, sums: Array, limit: float, names: Sequence[str] = ()
) -> None:
    """Control charts side by side: statistics of several orders (columns) under their limit."""
    for k, values in enumerate(np.asarray(sums).T):
        over = not names and float(values[-1]) > limit
        ax.plot(
            x, values, color=palette.WARNING if over else palette.run_colour(k if names else 0),
            marker=palette.run_marker(k) if names else "o", markersize=4.0, linewidth=1.2,
            label=names[k] if names else None,
        )  # fmt: skip
    ax.axhline(limit, color=palette.ink(ax), linestyle="--", linewidth=1.0, label="limit")
    # Limits beyond which a chart has a scale of logarithms.
    if float(np.max(sums)) > 10.0 * limit:
        ax.set_yscale("symlog", linthresh=limit)
    ax.set_ylim(0.0, 1.1 * max(limit, float(np.max(sums))))
    grid(ax)


def fleet_history(fleet: Fleet, unit: str, errors_in: ErrorsIn = "auto") -> Axes:
    """One unit's control charts: T^2 and cumulative sum of every order on each further date.

    Parameters
    ----------
    fleet : Fleet
    unit : str
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unused: the charts have no unit.

    Returns
    -------
    matplotlib Axes
        The upper of a new figure's two.

    Raises
    ------
    ArgumentError
        A unit that was not calibrated again.
    """
    rows = [row for row in fleet.history if row.unit == unit]
    again = list(dict.fromkeys(row.unit for row in fleet.history))
    if not rows:
        check_choice("unit", unit, again or ["(none was calibrated again)"])
    figure, (upper, lower) = new_figure(2, 1, 7.5, 5.5, sharey=False)
    when: list[Any] = [datetime.fromisoformat(row.when) for row in rows]
    for ax, name, limit, values in (
        (upper, "$T^2$ against the first date", rows[-1].limit, [
            [one.statistic for one in row.orders] for row in rows
        ]),
        (lower, "cumulative sum", rows[-1].cusum_limit, [
            [one.cusum for one in row.orders] for row in rows
        ]),
    ):  # fmt: skip
        draw_sums(ax, when, np.array(values), limit, [f"order {r.order:g}" for r in rows[0].orders])
        ax.set_ylabel(name)
    legend(upper)
    upper.set_title(f"Control charts of {unit}", fontsize="medium")
    figure.autofmt_xdate()
    return described(
        upper,
        f"Control charts of {unit} on {counted(rows, 'date')}: {rows[-1].verdict} at the last.",
    )


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
    # Orders of a watched joint that are plotted at most: those whose sums rose highest.
    drawn = np.sort(np.argsort(-sums.max(axis=0), kind="stable")[:6])
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
    upper.set_title("Charts of a watched joint", fontsize="medium")
    figure.align_ylabels()
    told = f"; the first in window {alarms[0].window}: " if alarms else ""
    first = told + shown.spoken(alarms[0].because) if alarms else ""
    return described(
        upper,
        f"Charts of {counted(windows, 'window')} of a watched joint with their limit, "
        f"{counted(alarms, 'alarm')}{first}.",
    )
