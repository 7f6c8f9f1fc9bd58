"""Figures of the diagnosis: measured against simulated, and what is left without each cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..plots.readingpictures import comparison_picture
from ..plots.simulatedcurves import ErrorLeft, error_left_of, simulated_points
from .charts import Chart, Figure, figure
from .panelcharts import figure_of
from .scale import Scale

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..runs.run import CalibrationRun
    from ..simulation import Simulation

__all__ = ["figures_of"]

#: Part of the measured error that a simulation must expect to be drawn beside it.
_FLAT = 1e-3
#: Height of one of the charts that stand above each other.
_HEIGHT_REM = 16.0


def figures_of(
    diagnosis: Diagnosis,
    runs: Sequence[CalibrationRun],
    sim: Simulation,
    scale: Scale,
) -> dict[str, Figure]:
    """Measured against simulated; what is left without each of several causes.

    A chart of one dot says less than the sentence beside it: it is left out; so is a simulation
    that expects no error, beside which the measured one would be drawn once more.
    """
    pairs = simulated_points(runs, sim)
    expected = max(float(np.ptp(simulated.y)) for _, simulated in pairs)
    found = {}
    if expected > _FLAT * diagnosis.discrepancy.peak_to_peak:
        picture = comparison_picture(pairs, scale.unit, diagnosis.extended)
        arrangement = "stacked" if len(picture.panels) == 2 else "above"
        found["measured-simulated"] = figure_of(picture, scale, arrangement, height_rem=_HEIGHT_REM)
    left = error_left_of(diagnosis)
    if left is not None and len(left.rows) > 2:
        found["error-left"] = _left(left, scale)
    return found


def _left(left: ErrorLeft, scale: Scale) -> Figure:
    """On a logarithmic axis: one cause may leave a hundred times what another does."""
    # The title says "without each cause".
    names = [name.removeprefix("without ") for name, _ in left.rows]
    sizes = scale.of(np.array([rms for _, rms in left.rows]))
    noise = float(scale.of(np.array([left.noise]))[0])
    low, high = 0.6 * min(float(sizes.min()), noise), 1.5 * max(float(sizes.max()), noise)
    chart = Chart(
        left.axis(scale.unit),
        "",
        x_range=(low, high),
        log_x=True,
        categories=names,
        height_rem=7.0 + 2.0 * len(names),
    )
    hover = f"@y: @x{{{scale.finest}}} {scale.name} rms"
    chart.level_dots(names[:1], sizes[:1], colour="after", hover=hover)
    chart.level_dots(names[1:], sizes[1:], colour="before", hover=hover)
    chart.upright(noise, label=f"noise of one reading, {scale.unit.text(left.noise)}")
    return figure(left.told(scale.unit), [chart])
