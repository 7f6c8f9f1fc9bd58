"""Axes to draw on: matplotlib at first use, with a clear error where it is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["legend", "new_axes", "turn_axis"]

#: Entries of a legend beyond which it stands beside the picture, not inside.
_MANY: int = 5


def new_axes(ax: Axes | None, *, polar: bool = False, height: float = 4.0) -> Axes:
    """``ax`` itself, or the axes of a new figure.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise MissingExtraError("pictures need matplotlib: pip install 'trueangle[plot]'") from None
    kind: dict[str, Any] = {"projection": "polar"} if polar else {}
    _, made = pyplot.subplots(
        figsize=(5.0 if polar else 7.5, 5.0 if polar else height),
        layout="constrained",
        subplot_kw=kind,
    )
    return made


def turn_axis(ax: Axes, low: float = 0.0, high: float = 360.0) -> None:
    """Angle axis in degrees, with whole parts of a turn as ticks."""
    from matplotlib.ticker import MultipleLocator

    ax.set_xlim(low, high)
    span = high - low
    for step in (5.0, 15.0, 30.0, 45.0, 90.0, 360.0, 1800.0):
        if span / step <= 9.0:
            ax.xaxis.set_major_locator(MultipleLocator(step))
            break
    ax.grid(True, color="#00000018", linewidth=0.8)


def legend(ax: Axes, title: str | None = None) -> None:
    """The legend: inside while short, beside the picture when long."""
    handles, _ = ax.get_legend_handles_labels()
    if not handles:
        return
    if len(handles) <= _MANY:
        # Room above the data, so that no entry covers a reading.
        low, high = ax.get_ylim()
        if ax.name != "polar":
            ax.set_ylim(low, high + 0.2 * (high - low))
        ax.legend(
            title=title,
            loc="upper center",
            ncols=len(handles),
            frameon=False,
            fontsize="small",
            markerscale=2.0,
        )
    else:
        columns = 1 + (len(handles) - 1) // 18
        ax.legend(
            title=title,
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            frameon=False,
            ncols=columns,
            fontsize="small",
        )
