"""The report on a watched joint: its alarms in front, then the charts of all windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from ..errors import ArgumentError
from ..model.alarm import WatchedWindow
from ..support.angles import arcsec
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import counted
from .chartaxes import ChartAxis
from .page import Page, filled_template
from .stills import StillMark, StillPicture, still_picture

#: Orders whose windows are drawn at most: those whose sums rose highest.
_DRAWN: Final = 12


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
        from markupsafe import Markup

        highest = np.argsort(-self._sums.max(axis=0), kind="stable")
        drawn = np.sort(highest[:_DRAWN]).tolist()
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
            svg=Markup,
        )

    def to_dict(self) -> dict[str, Any]:
        """Every number of the page: the windows as ``trueangle watch`` prints their objects."""
        return {"windows": [window.plain(self._scale) for window in self.windows]}

    def summary(self) -> str:
        """How many windows, and what the first alarm says."""
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

    def _across(self) -> ChartAxis:
        first, last = float(self._number[0]), float(self._number[-1])
        axis = ChartAxis("window", (first - 0.5, last + 0.5))
        axis.at_whole(first, last, 8)
        return axis

    def _limited(self, values: Array) -> tuple[list[StillMark], ChartAxis]:
        """Sums over the windows under their limit."""
        limit = self.windows[-1].limit
        across = self._across()
        up = ChartAxis("cumulative sum", (0.0, 1.1 * max(limit, float(values.max()))))
        marks = [StillMark("line", (across.limits, (limit, limit)), "muted")]
        return [*marks, StillMark("line", (self._number, values), "after")], up

    def _chart(self) -> StillPicture:
        """The largest sum of all charts, those of the zero with them, and the alarms."""
        largest = np.array([window.statistic for window in self.windows])
        marks, up = self._limited(largest)
        if self.alarms:
            places = [(one.window, one.statistic) for one in self.alarms]
            marks.append(
                StillMark("dots", tuple(np.array(places, dtype=np.float64).T), "warning", 8.0)
            )
        title = "largest cumulative sum of all charts"
        alt = f"{title} over {counted(self.windows, 'window')} with its limit, {self._told()}"
        return StillPicture(title, alt, still_picture(marks, self._across(), up, 14.0, 1.0))

    def _order(self, k: int) -> tuple[StillPicture, StillPicture]:
        """The sums of one order, and what it is off the model by."""
        order = f"order {self.windows[0].orders[k].order:g}"
        marks, up = self._limited(self._sums[:, k])
        title = f"{order}: cumulative sum"
        alt = f"{title}, {float(self._sums[:, k].max()):.3g} at most"
        sums = StillPicture(title, alt, still_picture(marks, self._across(), up, 9.0, 0.5))
        size = self._scale * self._sizes[:, k]
        title = f"{order}: less the model"
        alt = f"{title}, {self.unit.text(float(size.max()))} at most"
        shown = self.unit.per_arcsec * size
        up = ChartAxis(f"size / {self.unit.name}", (0.0, 1.1 * float(shown.max()) or 1.0))
        marks = [StillMark("line", (self._number, shown), "after")]
        return sums, StillPicture(title, alt, still_picture(marks, self._across(), up, 9.0, 0.5))
