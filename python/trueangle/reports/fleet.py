"""The report on a fleet: who needs what in front, then the units' patterns, spread and dates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from ..fleets.history import HistoryRow
from ..fleets.result import CommonOrder, Fleet, FleetUnit
from ..plots.controlcharts import draw_sums
from ..plots.fleetpictures import draw_pattern, draw_phasor_plane, turn_pattern
from ..plots.pagechart import LOW, page_axes, page_chart
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from .page import Page, filled_template

#: Units whose patterns are plotted at most, those that need something first.
_DRAWN: Final = 24
#: Width of a chart, inches.
_WIDTH: Final = 2.8


@dataclass(frozen=True, eq=False)
class FleetReport(Page):
    """A page on the units of a fleet: verdicts, patterns, spread, limits and dates.

    It holds no script: every picture is on paper what it is on the screen.

    Attributes
    ----------
    fleet : Fleet
    title : str
    errors_in : str or float
        Unit of the errors.
    """

    fleet: Fleet
    title: str = "Angle error of a fleet"
    errors_in: ErrorsIn = "auto"

    @cached_property
    def unit(self) -> ErrorUnit:
        """The unit of the errors on the page."""
        sizes = (unit.peak_to_peak for unit in self.fleet.units)
        return error_unit(self.errors_in, self._scale * max(sizes, default=0.0), self.fleet.period)

    @property
    def _scale(self) -> float:
        return arcsec(1.0, self.fleet.period)

    def _written(self) -> str:
        odd = [unit for unit in self.fleet.units if unit.verdict != "fine"]
        drawn = self.fleet.units[:_DRAWN]
        return filled_template(
            "fleet.html.j2",
            title=self.title,
            fleet=self.fleet,
            odd=odd,
            told=[unit for unit in self.fleet.units if unit.because],
            latest=self._latest(),
            charts=[self._chart(unit.unit) for unit in odd if self._dates(unit.unit) > 1],
            scale=self._scale,
            unit=self.unit,
            patterns=[self._pattern(unit) for unit in drawn],
            phasors=[self._phasor(at) for at in self._spread_most()],
            orders=list(zip(self.fleet.common, self.fleet.between, strict=True)),
        )

    def to_dict(self) -> dict[str, Any]:
        """Every number of the page: `Fleet.to_dict`."""
        return self.fleet.to_dict()

    def summary(self) -> str:
        """That of the fleet."""
        return self.fleet.summary(self.errors_in)

    def _brief(self) -> str:
        return self.fleet._brief()

    def _spread_most(self) -> list[int]:
        order = np.argsort([-row.std for row in self.fleet.between], kind="stable")
        # Orders whose phasors are plotted: those in which units differ most.
        return [int(k) for k in order[:3]]

    def _latest(self) -> list[HistoryRow]:
        """The last date of each unit, the first due first."""
        rows = {row.unit: row for row in self.fleet.history}
        return sorted(rows.values(), key=lambda row: (row.next_calibration or "9", row.unit))

    def _dates(self, unit: str) -> int:
        return sum(row.unit == unit for row in self.fleet.history)

    @property
    def _size(self) -> float:
        return self._scale * self.unit.per_arcsec

    @cached_property
    def _highest(self) -> float:
        """What the axes of all patterns reach to."""
        angle = np.linspace(0.0, 360.0, 361)
        patterns = [turn_pattern(unit.orders, angle) for unit in self.fleet.units[:_DRAWN]]
        return 1.1 * self._size * float(np.abs(patterns).max(initial=0.0)) or 1.0

    def _chart(self, unit: str) -> dict[str, Any]:
        """The cumulative sums of a unit's orders over its dates, and their limit."""
        rows = [row for row in self.fleet.history if row.unit == unit]
        ax = page_axes(_WIDTH, 2.0)
        sums = np.array([[one.cusum for one in row.orders] for row in rows])
        draw_sums(ax, np.arange(2.0, len(rows) + 2.0), sums, rows[-1].cusum_limit)
        ax.set_xlim(1.5, len(rows) + 1.5)
        ax.locator_params(axis="x", integer=True)
        ax.set_xlabel("date")
        ax.set_ylabel("cumulative sum")
        title = f"{unit}: cumulative sums of its orders"
        alt = f"{title} on {len(rows)} further dates, limit {rows[-1].cusum_limit:.3g}"
        return page_chart(ax, title=title, height=LOW) | {"alt": alt}

    def _pattern(self, unit: FleetUnit) -> dict[str, Any]:
        """The error of a unit over a turn; the same axis for all, so that sizes compare."""
        ax = page_axes(_WIDTH, 2.0)
        draw_pattern(ax, self.fleet, unit, self._size)
        ax.set_ylim(-self._highest, self._highest)
        ax.set_xlabel("true angle / deg")
        ax.set_ylabel(f"error / {self.unit.name}")
        title = f"{unit.unit}: {unit.verdict.replace('_', ' ')}"
        ptp = self.unit.text(self._scale * unit.peak_to_peak)
        chart = page_chart(ax, title=title, height=LOW)
        return chart | {"alt": f"error of {title}, {ptp} peak-to-peak"}

    def _phasor(self, at: int) -> dict[str, Any]:
        """Cosine and sine of one order of every unit, and the circle that holds 95 % of them."""
        common: CommonOrder = self.fleet.common[at]
        ax = page_axes(_WIDTH, _WIDTH)
        draw_phasor_plane(ax, self.fleet, at, self._size)
        ax.set_xlabel(f"cosine / {self.unit.name}")
        ax.set_ylabel(f"sine / {self.unit.name}")
        title = f"order {common.order:g} of the {common.shaft}"
        alt = f"cosine and sine of {title} of every unit, and the circle that holds 95 % of them"
        return page_chart(ax, title=title, height="aspect-ratio:0.98") | {"alt": alt}
