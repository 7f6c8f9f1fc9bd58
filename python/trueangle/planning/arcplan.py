"""A plan of places on an arc, and its words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult
from .tables import place_table, plain_arc_plan


@dataclass(frozen=True)
class ArcPlan(PlainResult):
    """Places on an arc and readings at each of them.

    Attributes
    ----------
    start_deg, stop_deg : float
    orders : tuple of float
        Output orders, fitted together with a zero of each run.
    places_deg : tuple of float
        Increasing; the same in every run.
    counts : tuple of int
        Readings at each place in one run; half of them from either side with
        ``both_directions``.
    runs : int
    both_directions : bool
    d_efficiency : float
        ``(det M / det M^*)^(1/p)``, M the information of these readings, M* the most that
        as many can have.
    efficiency_of_even_spacing : float
        The same for as many places spread evenly, both ends among them.
    noise_factors : dict of order to float
        How many times a coefficient scatters more than one of as many readings over whole turns.
    even_noise_factors : dict of order to float
        The same for even spacing.
    uncertainty_arcsec : float or None
        Expanded uncertainty (k = 2) of the curve, with its zero, at the worst place of the arc;
        None without the noise of a reading.
    notes : tuple of str
    """

    start_deg: float
    stop_deg: float
    orders: tuple[float, ...]
    places_deg: tuple[float, ...]
    counts: tuple[int, ...]
    runs: int
    both_directions: bool
    d_efficiency: float
    efficiency_of_even_spacing: float
    noise_factors: dict[float, float]
    even_noise_factors: dict[float, float]
    uncertainty_arcsec: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def readings(self) -> int:
        """All readings of all runs."""
        return self.runs * sum(self.counts)

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor."""
        return max(self.noise_factors.values())

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON for an arc."""
        return plain_arc_plan(self, "arc")

    def summary(self) -> str:
        """The plan as text: a table to follow at the rig."""
        each = f": {sum(self.counts)} in each of {self.runs} runs" if self.runs > 1 else ""
        way = ", half from either side" if self.both_directions else ""
        lines = [
            f"{self.readings} readings over {self.start_deg:g} to {self.stop_deg:g} deg{each}{way}",
            *place_table(self.places_deg, self.counts),
            f"  D-efficiency           {self.d_efficiency:.3f} of the best possible",
            f"  of even spacing        {self.efficiency_of_even_spacing:.3f}",
            "  order  noise factor  with even spacing",
        ]
        for order, factor in self.noise_factors.items():
            even = self.even_noise_factors[order]
            lines.append(f"  {order:5g}  {_factor(factor):>12}  {_factor(even):>17}")
        if self.uncertainty_arcsec is not None:
            lines.append(
                f"  uncertainty (k = 2)    {self.uncertainty_arcsec:.3g} arcsec at the worst place"
            )
        lines += [f"  note: {note}" for note in self.notes]
        return laid_out(lines)

    def _brief(self) -> str:
        return (
            f"{self.readings} readings at {counted(self.places_deg, 'place')}, "
            f"worst factor {self.worst_noise_factor:.3g}"
        )


def _factor(factor: float) -> str:
    """A noise factor, or that the places do not show the order."""
    return f"{factor:.3g}" if math.isfinite(factor) else "not seen"
