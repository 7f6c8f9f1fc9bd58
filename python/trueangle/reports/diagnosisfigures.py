"""Figures of the diagnosis: measured against simulated, what is left, gains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..plots import curves
from ..plots.curves import Points
from ..plots.simulatedcurves import gain_bars, left_without, simulated_points
from .charts import Chart, Figure, figure
from .figures import run_dots, turn
from .scale import Scale

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..runs import CalibrationRun
    from ..simulation import Simulation

__all__ = ["figures_of"]

#: Readings drawn of what is measured and of what is simulated.
_MOST_POINTS = 3_000


def figures_of(
    diagnosis: Diagnosis,
    runs: Sequence[CalibrationRun],
    sim: Simulation,
    scale: Scale,
) -> dict[str, Figure]:
    """Measured against simulated; what is left without each cause, and gains, of several causes.

    A chart of one bar says less than the sentence beside it: it is left out.
    """
    found = {"measured-simulated": _compared(runs, sim, scale)}
    left = left_without(diagnosis)
    if len(left) > 2:
        found["error-left"] = _left(diagnosis, left, scale)
    if len(gain_bars(diagnosis)) > 1:
        found["gains"] = _gains(diagnosis)
    return found


def _compared(runs: Sequence[CalibrationRun], sim: Simulation, scale: Scale) -> Figure:
    """Both in one chart, the difference below: neither hides another."""
    pairs = simulated_points(runs, sim)
    low, high = turn(None)
    both = Chart("", f"error / {scale.name}", x_range=(low, high), height_rem=16.0)
    apart = Chart(
        "reference angle / deg",
        f"difference / {scale.name}",
        x_range=(low, high),
        height_rem=16.0,
    )
    for chart in (both, apart):
        chart.angle_axis(low, high)
    most = max(50, _MOST_POINTS // len(runs))
    for number, (measured, simulated) in enumerate(pairs):
        for name, points, marker, hollow in (
            ("measured", measured, "circle", True),
            ("simulated", simulated, "circle", False),
        ):
            part = curves.thinned(scale.points(points), most)
            both.dots(
                part.x,
                part.y,
                colour="before" if name == "measured" else "model",
                label=name,
                marker=marker,
                size=5.0 if hollow else 2.0,
                hollow=hollow,
                run=number,
                hover=f"run {measured.label}, {name}: {scale.read} at @x{{0.00}}°",
            )
        rest = scale.points(Points(measured.label, measured.x, measured.y - simulated.y))
        run_dots(apart, number, rest, len(runs), scale)
    alt = (
        f"Measured error of {len(runs)} runs and the error that the simulation expects at the same "
        f"readings, and below it the measured less the simulated one, in {scale.name} over a turn."
    )
    return figure(alt, [both, apart], "stacked")


def _left(diagnosis: Diagnosis, left: Sequence[tuple[str, float]], scale: Scale) -> Figure:
    names = [name for name, _ in left]
    sizes = scale.of(np.array([rms for _, rms in left]))
    noise = scale.of(np.array([diagnosis.noise]))[0]
    hover = f"@y: @x{{{scale.finest}}} {scale.name} rms"
    chart = Chart(
        f"rms left of held-out readings / {scale.name}",
        "",
        x_range=(0.0, 1.08 * float(max(sizes.max(), noise))),
        categories=names,
        height_rem=7.0 + 2.0 * len(names),
    )
    chart.bars(names[:1], sizes[:1], colour="after", hover=hover)
    chart.bars(names[1:], sizes[1:], colour="before", hover=hover)
    told = scale.unit.text(diagnosis.noise)
    chart.upright(noise, label=f"noise of one reading, {told}")
    alt = (
        "Rms left of held-out readings with all causes in place and without each: "
        + ", ".join(f"{name} {scale.unit.text(rms)}" for name, rms in left)
        + f". Noise of one reading {told}."
    )
    return figure(alt, [chart])


def _gains(diagnosis: Diagnosis) -> Figure:
    bars = gain_bars(diagnosis)
    names = [f"{i}. {bar.cause}" for i, bar in enumerate(bars, start=1)]
    share = np.array([bar.share for bar in bars])
    low = np.array([min(bar.low, bar.share) for bar in bars])
    high = np.array([max(bar.high, bar.share) for bar in bars])
    chart = Chart(
        "share of the reducible error taken away / %",
        "",
        x_range=(min(0.0, 1.05 * float(low.min())), max(100.0, 1.05 * float(high.max()))),
        categories=names,
        height_rem=7.0 + 2.0 * len(names),
    )
    chart.bars(names, share, colour="after", hover="@y: @x{0.0} %", low=low, high=high)
    alt = "Share of the reducible error that each cause takes away on held-out runs: " + ", ".join(
        f"{bar.cause} {bar.share:.0f} % ({bar.low:.0f} to {bar.high:.0f} %)" for bar in bars
    )
    return figure(alt, [chart])
