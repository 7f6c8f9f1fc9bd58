"""The report on a watched joint: its alarms in front, then the charts of all windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..model.monitor import WatchedWindow
from ..plots import palette
from ..plots.controlcharts import draw_sums
from ..plots.pagechart import LOW, page_axes, page_chart
from ..support.angles import arcsec
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import counted
from .page import Page, filled_template

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Widths of charts, inches.
_WIDE, _HALF = 7.5, 3.7


@dataclass(frozen=True, eq=False)
class WatchReport(Page):
    """A page on a running joint: its alarms, the charts with their limit, and every order.

    It holds no script: every picture is on paper what it is on the screen.

    Parameters
    ----------
    windows : sequence of WatchedWindow
        Every window of a `trueangle.Monitor` (its ``windows_of``).
    period : float
        Of the model.
    title : str
    errors_in : str or float
        Unit of the errors.

    Raises
    ------
    ArgumentError
        No windows.

    Examples
    --------
    >>> import numpy as np
    >>> import trueangle as ta
    >>> model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.05])], period=360.0)
    >>> angle = np.arange(0.0, 20 * 360.0, 3.0)
    >>> windows = ta.Monitor(model).windows_of(angle, model.error(angle))
    >>> print(WatchReport(windows, model.period).summary())
    19 windows, no alarm
    """

    windows: list[WatchedWindow]
    period: float
    title: str = "A watched joint"
    errors_in: ErrorsIn = "auto"

    def __post_init__(self) -> None:
        if not self.windows:
            raise ArgumentError("windows is empty: no window of travel has ended")

    @property
    def alarms(self) -> list[WatchedWindow]:
        """The windows that alarm."""
        return [window for window in self.windows if window.alarm]

    @cached_property
    def unit(self) -> ErrorUnit:
        """The unit of the errors on the page."""
        return error_unit(self.errors_in, self._scale * float(self._sizes.max()), self.period)

    def _written(self) -> str:
        highest = np.argsort(-self._sums.max(axis=0), kind="stable")
        # Orders whose windows are plotted at most: those whose sums rose highest.
        drawn = np.sort(highest[:12]).tolist()
        return filled_template(
            "watched.html.j2",
            title=self.title,
            windows=self.windows,
            alarms=self.alarms,
            told=self._told(),
            unit=self.unit,
            chart=self._chart(),
            orders=[pair for k in drawn for pair in self._order(k)],
            drawn=len(drawn),
        )

    def to_dict(self) -> dict[str, Any]:
        """Every number of the page: the windows as ``trueangle watch`` prints their objects."""
        return {"windows": [window.plain(self._scale) for window in self.windows]}

    def summary(self) -> str:
        """How many windows, and what the first alarm reports."""
        text = f"{counted(self.windows, 'window')}, {self._told()}"
        if not self.alarms:
            return text
        first = self.alarms[0]
        return f"{text}\nwindow {first.window}: {self.unit.spoken(first.because)}"

    def _told(self) -> str:
        return counted(self.alarms, "alarm") if self.alarms else "no alarm"

    def _brief(self) -> str:
        return self.summary().partition("\n")[0]

    @property
    def _scale(self) -> float:
        return arcsec(1.0, self.period)

    @cached_property
    def _number(self) -> Array:
        return np.array([window.window for window in self.windows], dtype=np.float64)

    @cached_property
    def _sums(self) -> Array:
        return np.array([[row.statistic for row in one.orders] for one in self.windows])

    @cached_property
    def _sizes(self) -> Array:
        return np.array([[row.amplitude for row in one.orders] for one in self.windows])

    def _axes(self, width: float, title: str) -> Axes:
        """Axes over the windows."""
        ax = page_axes(width, 0.35 * width)
        first, last = float(self._number[0]), float(self._number[-1])
        ax.set_xlim(first - 0.5, last + 0.5)
        ax.locator_params(axis="x", integer=True)
        ax.set_xlabel("window")
        ax.set_ylabel(title)
        return ax

    def _chart(self) -> dict[str, Any]:
        """The largest sum of all charts, those of the zero with them, and the alarms."""
        largest = np.array([[window.statistic] for window in self.windows])
        ax = self._axes(_WIDE, "cumulative sum")
        draw_sums(ax, self._number, largest, self.windows[-1].limit)
        if self.alarms:
            x, y = zip(*((one.window, one.statistic) for one in self.alarms), strict=True)
            ax.plot(x, y, linestyle="none", marker="D", color=palette.WARNING, label="alarm")
        title = "largest cumulative sum of all charts"
        alt = f"{title} over {counted(self.windows, 'window')} with its limit, {self._told()}"
        return page_chart(ax, title=title, height="height:14rem") | {"alt": alt}

    def _order(self, k: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """The sums of one order, and what it is off the model by."""
        order = f"order {self.windows[0].orders[k].order:g}"
        ax = self._axes(_HALF, "cumulative sum")
        draw_sums(ax, self._number, self._sums[:, k : k + 1], self.windows[-1].limit)
        title = f"{order}: cumulative sum"
        alt = f"{title}, {float(self._sums[:, k].max()):.3g} at most"
        sums = page_chart(ax, title=title, height=LOW) | {"alt": alt}
        size = self._scale * self._sizes[:, k]
        shown = self.unit.per_arcsec * size
        ax = self._axes(_HALF, f"size / {self.unit.name}")
        ax.plot(self._number, shown, color=palette.AFTER)
        ax.set_ylim(0.0, 1.1 * float(shown.max()) or 1.0)
        title = f"{order}: less the model"
        alt = f"{title}, {self.unit.text(float(size.max()))} at most"
        return sums, page_chart(ax, title=title, height=LOW) | {"alt": alt}
