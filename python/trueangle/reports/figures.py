"""Figures of a page: errors, before and after, residuals, phases, and those of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from ..errors import RankError
from ..fitting.phases import Phases, run_phases
from ..plots import curves
from ..plots.curves import Points
from ..plots.orderlines import order_lines
from ..plots.readingpictures import (
    before_after_picture,
    comparison_picture,
    errors_picture,
    residual_picture,
)
from ..plots.simulatedcurves import ErrorLeft, error_left_of, simulated_points
from ..support.arrays import Array
from ..support.display_units import significant_digits
from ..support.layout import counted
from .charts import Chart, Figure, chart_figure, chart_run_marker, css_run_colour
from .linenames import LineNames
from .panelcharts import panel_figure
from .scale import ErrorScale
from .spectrum import spectrum_figure

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.heldout import HeldOut
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult
    from ..runs.run import CalibrationRun
    from ..simulation import Simulation


def figures_of_runs(
    runs: Sequence[CalibrationRun],
    fit: FitResult | None,
    selection: OrderSelection | None,
    held: HeldOut | None,
    name: LineNames,
    scale: ErrorScale,
) -> dict[str, Figure]:
    """Figures of a report on runs: those that the fit, the selection and the gain allow."""
    made = {"errors": panel_figure(errors_picture(runs, fit, scale.unit), scale)}
    # At one place no order can be looked for.
    if fit is not None or (selection is not None and order_lines(selection)):
        made["spectrum"] = spectrum_figure(fit, selection, name, scale)
    if held is not None:
        made["before-after"] = _before_after(held, runs, scale)
    if fit is not None:
        multiples = phase_figure(fit, name, scale)
        if multiples is not None:
            made["phases"] = multiples
        for signal in _signals_present(fit):
            picture = residual_picture(fit, signal, scale.unit)
            made[f"residual-{signal}"] = panel_figure(picture, scale)
    return made


def _before_after(held: HeldOut, runs: Sequence[CalibrationRun], scale: ErrorScale) -> Figure:
    """Error of every held-out run before and after correction."""
    pairs, span = [], curves.travelled_degrees(runs)
    for run in held.runs:
        x = curves.reference_degrees(run.run, span[0])
        number = next(i for i, known in enumerate(runs) if known is run.run)
        pairs.append((number, Points(run.label, x, run.before), Points(run.label, x, run.after)))
    return panel_figure(before_after_picture(pairs, span, scale.unit), scale)


def _signals_present(fit: FitResult) -> list[curves.Signal]:
    """Signals that the residual can be drawn against: those that any run has and that vary."""
    found = []
    for name in curves.SIGNALS:
        values = [v for run in fit.runs if (v := _signal(run, name)) is not None]
        if values and float(np.ptp(np.concatenate(values))) > 0.0:
            found.append(name)
    return found


def _signal(run: CalibrationRun, name: str) -> Array | None:
    value: Array | None = run.reference if name == "angle" else getattr(run, name)
    return value


#: Part of the measured error that a simulation must expect to be drawn beside it.
_FLAT = 1e-3
#: Height of one of the charts that stand above each other.
_HEIGHT_REM = 16.0


def figures_of_diagnosis(
    diagnosis: Diagnosis,
    runs: Sequence[CalibrationRun],
    sim: Simulation,
    scale: ErrorScale,
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
        found["measured-simulated"] = panel_figure(
            picture, scale, arrangement, height_rem=_HEIGHT_REM
        )
    left = error_left_of(diagnosis)
    if left is not None and len(left.rows) > 2:
        found["error-left"] = _left(left, scale)
    return found


def _left(left: ErrorLeft, scale: ErrorScale) -> Figure:
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
    return chart_figure(left.told(scale.unit), [chart])


#: Orders shown, the largest.
_MOST: Final = 12
#: Half height of a chart in degrees at least: nothing is made to look like scatter.
_LEAST: Final = 15.0


def phase_figure(fit: FitResult, name: LineNames, scale: ErrorScale) -> Figure | None:
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
        f"Phases of {counted(charts, 'order')}, a chart for each, one dot per run. Dots of one "
        "order on a level line are a systematic error."
    )
    return chart_figure(alt, charts, "multiples")


def _of_order(order: Phases, numbers: dict[str, int], name: str, scale: ErrorScale) -> Chart:
    mean = np.angle(np.mean(order.amplitude * np.exp(1j * order.phase)))
    around = np.angle(np.exp(1j * (order.phase - mean)))
    degrees = np.degrees(mean + around)
    middle = float(np.degrees(mean))
    if middle < 0.0:
        degrees, middle = degrees + 360.0, middle + 360.0
    half = min(max(1.3 * float(np.abs(np.degrees(around)).max()), _LEAST), 190.0)
    size = significant_digits(scale.factor * float(order.amplitude.mean()), 3)
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
            colour=css_run_colour(number),
            marker=chart_run_marker(number),
            run=number,
            size=8.0,
            hover=f"run {label}: {scale.unit.text(float(order.amplitude[place]))} at @y{{0.0}}°",
        )
    return chart
