"""One axis of a chart: what it shows, its scale, its ticks and the grid across it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from .bokehmodels import Model, bokeh_model, bokeh_reference

#: Decades of a logarithmic axis up to which it has ticks within them.
_FEW_DECADES: Final = 4
#: Steps of angles and of whole numbers between ticks.
_ANGLES: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0, 360.0, 1800.0)
_WHOLE: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 10**9)


@dataclass
class ChartAxis:
    """An axis.

    Attributes
    ----------
    title : str
    limits : (float, float), optional
        By default what the data cover.
    log : bool
    categories : sequence of str, optional
        Listed from the top down instead of numbers.
    visible : bool
    ticks : list of float, optional
        By default Bokeh's.
    """

    title: str
    limits: tuple[float, float] | None = None
    log: bool = False
    categories: Sequence[str] | None = None
    visible: bool = True
    ticks: list[float] | None = None

    def at_angles(self, low: float, high: float, most: float) -> None:
        """Ticks at whole parts of a turn, about ``most`` of them."""
        for step in _ANGLES:
            if (high - low) / step <= most:
                first = np.ceil(low / step)
                self.ticks = (step * np.arange(first, np.floor(high / step) + 1.0)).tolist()
                return

    def at_whole(self, low: float, high: float, most: int) -> None:
        """Ticks at whole numbers, at most so many."""
        step = next(s for s in _WHOLE if (high - low) / s < most)
        self.ticks = np.arange(step * np.ceil(low / step), high + 1e-9, step).tolist()

    def range(self) -> Model:
        """What the axis shows."""
        if self.categories is not None:
            return bokeh_model("FactorRange", factors=list(reversed(list(self.categories))))
        if self.limits is None:
            return bokeh_model("DataRange1d")
        low, high = self.limits
        return bokeh_model("Range1d", start=float(low), end=float(high))

    def scale(self) -> Model:
        """How numbers become places."""
        return bokeh_model(f"{self._kind('Linear')}Scale")

    def drawn(self, dimension: int) -> tuple[Model, Model]:
        """The axis, and the grid that refers to it."""
        axis = bokeh_model(
            f"{self._kind('Linear')}Axis", axis_label=self.title or None, visible=self.visible
        )
        grid = bokeh_model("Grid", axis=bokeh_reference(axis), dimension=dimension)
        if self.log and self.limits is not None:
            self.ticks = _within_decades(*self.limits)
            axis["attributes"]["formatter"] = bokeh_model(
                "BasicTickFormatter", use_scientific=False
            )
        if self.ticks is not None:
            axis["attributes"]["ticker"] = bokeh_model("FixedTicker", ticks=self.ticks)
        return axis, grid

    def _kind(self, plain: str) -> str:
        return "Categorical" if self.categories is not None else "Log" if self.log else plain


def _within_decades(low: float, high: float) -> list[float]:
    """Ticks at 1, 2 and 5 of every decade while these are few, else at decades alone."""
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    marks = (1.0, 2.0, 5.0) if decades.size <= _FEW_DECADES else (1.0,)
    return [m * 10.0 ** float(d) for d in decades for m in marks if low <= m * 10.0**d <= high]
