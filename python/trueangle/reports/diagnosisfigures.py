"""Figures of the diagnosis: measured against simulated, and what is left without each cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..plots import curves
from ..plots.curves import Points, strong_gear_order
from ..plots.simulatedcurves import left_without, simulated_points
from .charts import Chart, Figure, figure
from .figures import dot_size, dots_of_run, run_dots, stretch_chart, within
from .scale import Scale

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..runs.run import CalibrationRun
    from ..simulation import Simulation

__all__ = ["figures_of"]

Array = NDArray[np.float64]

#: Part of a turn in degrees from which on the axis shows a whole one.
_MOST_OF_A_TURN = 300.0
#: Readings drawn of what is measured and of what is simulated.
_MOST_POINTS = 3_000
#: Part of the measured error that a simulation must expect to be drawn beside it.
_FLAT = 1e-3


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
        found["measured-simulated"] = _compared(runs, pairs, diagnosis.extended, scale)
    left = left_without(diagnosis)
    if len(left) > 2:
        found["error-left"] = _left(diagnosis, left, scale)
    return found


def _compared(
    runs: Sequence[CalibrationRun],
    expected: Sequence[tuple[Points, Points]],
    known: Simulation,
    scale: Scale,
) -> Figure:
    """Both in one chart, the difference below: neither hides another.

    Gear orders fill the chart of a turn: a stretch of a few periods beside it shows both.
    """
    pairs = [tuple(map(scale.points, pair)) for pair in expected]
    low, high = _span([measured.x for measured, _ in pairs])
    y = f"error / {scale.name}"
    both = Chart("", y, x_range=(low, high), height_rem=16.0, grow=2.0)
    apart = Chart(
        "reference angle / deg",
        f"difference / {scale.name}",
        x_range=(low, high),
        height_rem=16.0,
        grow=3.0,
    )
    for chart in (both, apart):
        chart.angle_axis(low, high)
    lines = known.harmonics
    orders = [known.joint.output_order(line.shaft, line.order) for line in lines]
    strong = strong_gear_order(orders, [line.amplitude_arcsec for line in lines], high - low)
    charts = [both]
    if strong is not None:
        charts.append(stretch_chart(strong, low, high, y, height_rem=16.0))
    size = dot_size(sum(len(run) for run in runs))
    most = dots_of_run(len(runs), _MOST_POINTS)
    for number, (measured, simulated) in enumerate(pairs):
        for chart in charts:
            stretch = chart is not both
            for name, points in (("measured", measured), ("simulated", simulated)):
                shown = (
                    within(points, *chart.x_range)
                    if stretch
                    else curves.thinned(points, most, number)
                )
                hollow = name == "measured"
                chart.dots(
                    shown.x,
                    shown.y,
                    colour="before" if hollow else "model",
                    label="" if stretch else name,
                    size=1.5 * size if hollow else 0.6 * size,
                    hollow=hollow,
                    run=number,
                    hover=f"run {measured.label}, {name}: {scale.read} at @x{{0.00}}°",
                )
        rest = Points(measured.label, measured.x, measured.y - simulated.y)
        run_dots(apart, number, rest, len(runs), scale, size=size)
    alt = (
        f"Measured error of {len(runs)} runs and the error that the simulation expects at the same "
        f"readings, and below it the measured less the simulated one, in {scale.name} over a turn."
    )
    return figure(alt, [*charts, apart], "stacked" if strong is None else "above")


def _span(angles: Sequence[Array]) -> tuple[float, float]:
    """A turn, or the part of it that was travelled."""
    low, high = min(float(x.min()) for x in angles), max(float(x.max()) for x in angles)
    return (0.0, 360.0) if high - low > _MOST_OF_A_TURN else (low, high)


def _left(diagnosis: Diagnosis, left: Sequence[tuple[str, float]], scale: Scale) -> Figure:
    """On a logarithmic axis: one cause may leave a hundred times what another does."""
    # The title says "without each cause".
    names = [name.removeprefix("without ") for name, _ in left]
    sizes = scale.of(np.array([rms for _, rms in left]))
    noise = float(scale.of(np.array([diagnosis.noise]))[0])
    low, high = 0.6 * min(float(sizes.min()), noise), 1.5 * max(float(sizes.max()), noise)
    chart = Chart(
        f"rms left / {scale.name}",
        "",
        x_range=(low, high),
        log_x=True,
        categories=names,
        height_rem=7.0 + 2.0 * len(names),
    )
    hover = f"@y: @x{{{scale.finest}}} {scale.name} rms"
    chart.level_dots(names[:1], sizes[:1], colour="after", hover=hover)
    chart.level_dots(names[1:], sizes[1:], colour="before", hover=hover)
    told = scale.unit.text(diagnosis.noise)
    chart.upright(noise, label=f"noise of one reading, {told}")
    alt = (
        "Rms left of held-out readings with all causes in place and without each: "
        + ", ".join(f"{name} {scale.unit.text(rms)}" for name, rms in left)
        + f". Noise of one reading {told}."
    )
    return figure(alt, [chart])
