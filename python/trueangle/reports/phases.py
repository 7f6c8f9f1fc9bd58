"""Phases of the orders run by run, a small chart for every order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..errors import RankError
from ..fitting.phases import Phases, run_phases
from ..support.display_units import significant
from .charts import Chart, Figure, figure, run_colour, run_marker
from .linenames import LineNames
from .scale import Scale

if TYPE_CHECKING:
    from ..fitting.result import FitResult

__all__ = ["phases"]

#: Orders shown, the largest.
_MOST: Final = 12
#: Half height of a chart in degrees at least: nothing is made to look like scatter.
_LEAST: Final = 15.0


def phases(fit: FitResult, name: LineNames, scale: Scale) -> Figure | None:
    """Phase of every order in every run; None where no run holds them, or there is one."""
    try:
        found = sorted(run_phases(fit), key=lambda p: -float(p.amplitude.mean()))[:_MOST]
    except RankError:
        return None
    if not found or len(found[0].labels) < 2:
        return None
    numbers = {(run.label or str(i + 1)): i for i, run in enumerate(fit.runs)}
    charts = [
        _of_order(order, numbers, name(order.order), scale)
        for order in sorted(found, key=lambda p: p.order)
    ]
    alt = (
        f"Phases of {len(charts)} orders, a chart for each, one dot per run. Dots of one order "
        "on a level line are a systematic error."
    )
    return figure(alt, charts, "multiples")


def _of_order(order: Phases, numbers: dict[str, int], name: str, scale: Scale) -> Chart:
    mean = np.angle(np.mean(order.amplitude * np.exp(1j * order.phase)))
    around = np.angle(np.exp(1j * (order.phase - mean)))
    degrees = np.degrees(mean + around)
    middle = float(np.degrees(mean))
    if middle < 0.0:
        degrees, middle = degrees + 360.0, middle + 360.0
    half = min(max(1.3 * float(np.abs(np.degrees(around)).max()), _LEAST), 190.0)
    size = significant(scale.factor * float(order.amplitude.mean()), 3)
    chart = Chart(
        "run",
        "phase / deg",
        x_range=(0.3, len(order.labels) + 0.7),
        y_range=(middle - half, middle + half),
        title=f"{name.capitalize()}: {size} {scale.name}",
        height_rem=11.0,
    )
    chart.whole_axis(1.0, float(len(order.labels)), 7)
    for place, label in enumerate(order.labels):
        number = numbers[label]
        chart.dots(
            np.array([place + 1.0]),
            degrees[place : place + 1],
            colour=run_colour(number),
            marker=run_marker(number),
            run=number,
            size=8.0,
            hover=f"run {label}: {scale.unit.text(float(order.amplitude[place]))} at @y{{0.0}}°",
        )
    return chart
