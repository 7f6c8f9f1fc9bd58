"""The report on a fleet: who needs what in front, then the units' patterns, spread and dates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from ..fleets.history import HistoryRow
from ..fleets.result import BetweenOrder, CommonOrder, Fleet
from ..fleets.unit import FleetUnit
from ..plots.fleetpictures import RADIUS_OF_95, turn_pattern
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from .chartaxes import ChartAxis
from .page import Page, filled_template
from .stills import StillMark, StillPicture, still_picture

#: Units whose patterns are drawn at most, those that need something first.
_DRAWN: Final = 24
#: Orders whose phasors are drawn: those in which units differ most.
_PHASORS: Final = 3
#: Angles of a pattern at least, and to a period of its highest order.
_ANGLES: Final = (361, 8)
#: Height, rem, at which a picture of a third of the page is as wide as high between its axes.
_SQUARE: Final = 14.6


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
        from markupsafe import Markup

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
            svg=Markup,
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
        return [int(k) for k in order[:_PHASORS]]

    def _latest(self) -> list[HistoryRow]:
        """The last date of each unit, the first due first."""
        rows = {row.unit: row for row in self.fleet.history}
        return sorted(rows.values(), key=lambda row: (row.next_calibration or "9", row.unit))

    def _dates(self, unit: str) -> int:
        return sum(row.unit == unit for row in self.fleet.history)

    def _chart(self, unit: str) -> StillPicture:
        """The cumulative sums of a unit's orders over its dates, and their limit."""
        rows = [row for row in self.fleet.history if row.unit == unit]
        date = np.arange(2.0, len(rows) + 2.0)
        limit = rows[-1].cusum_limit
        sums = np.array([[one.cusum for one in row.orders] for row in rows])
        most = 1.1 * max(limit, float(sums.max()))
        across = ChartAxis("date", (1.5, len(rows) + 1.5))
        across.at_whole(2.0, len(rows) + 1.0, 6)
        up = ChartAxis("cumulative sum", (0.0, most))
        marks = [StillMark("line", (across.limits, (limit, limit)), "muted")]
        for values in sums.T:
            colour = "warning" if float(values[-1]) > limit else "after"
            marks.append(StillMark("line", (date, values), colour))
        title = f"{unit}: cumulative sums of its orders"
        alt = f"{title} on {len(rows)} further dates, limit {limit:.3g}"
        return StillPicture(title, alt, still_picture(marks, across, up, 9.0, 1.0 / 3.0))

    def _pattern(self, unit: FleetUnit) -> StillPicture:
        """The error of a unit over a turn; the same axis for all, so that sizes compare."""
        size = self._scale * self.unit.per_arcsec
        highest = max((row.order for row in unit.orders), default=1.0)
        angle = np.linspace(0.0, 360.0, max(_ANGLES[0], math.ceil(_ANGLES[1] * highest) + 1))
        most = 0.5 * size * max(one.peak_to_peak for one in self.fleet.units[:_DRAWN]) * 1.1
        across = ChartAxis("true angle / deg", (0.0, 360.0))
        across.at_angles(0.0, 360.0, 4)
        up = ChartAxis(f"error / {self.unit.name}", (-most or -1.0, most or 1.0))
        colour = "after" if unit.verdict == "fine" else "warning"
        marks = [StillMark("line", (angle, size * turn_pattern(unit.orders, angle)), colour)]
        said = f"{unit.unit}: {unit.verdict.replace('_', ' ')}"
        ptp = self.unit.text(self._scale * unit.peak_to_peak)
        return StillPicture(
            said,
            f"error of {said}, {ptp} peak-to-peak",
            still_picture(marks, across, up, 9.0, 1.0 / 3.0),
        )

    def _phasor(self, at: int) -> StillPicture:
        """Cosine and sine of one order of every unit, and the circle that holds 95 % of them."""
        size = self._scale * self.unit.per_arcsec
        common: CommonOrder = self.fleet.common[at]
        between: BetweenOrder = self.fleet.between[at]
        turn = np.linspace(0.0, 2.0 * math.pi, 91)
        circle = RADIUS_OF_95 * between.std
        marks = [
            StillMark(
                "line",
                (
                    size * (common.cosine + circle * np.cos(turn)),
                    size * (common.sine + circle * np.sin(turn)),
                ),
                "muted",
            )
        ]
        for fine, colour in ((True, "after"), (False, "warning")):
            rows = [u.orders[at] for u in self.fleet.units if (u.verdict == "fine") == fine]
            if rows:
                phase = np.radians([row.phase_deg for row in rows])
                amplitude = size * np.array([row.amplitude for row in rows])
                places = (amplitude * np.sin(phase), amplitude * np.cos(phase))
                marks.append(StillMark("dots", places, colour, 8.0))
        reach = 1.1 * max(np.abs(part).max() for mark in marks for part in mark.arrays) or 1.0
        name = self.unit.name
        across = ChartAxis(f"cosine / {name}", (-reach, reach))
        up = ChartAxis(f"sine / {name}", (-reach, reach))
        title = f"order {common.order:g} of the {common.shaft}"
        alt = f"cosine and sine of {title} of every unit, and the circle that holds 95 % of them"
        return StillPicture(title, alt, still_picture(marks, across, up, _SQUARE, 1.0 / 3.0))
