"""Figures of readings over the angle: errors, before and after, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from ..plots import curves
from ..plots.curves import CONFIDENCE, Curve, Points
from ..support.plainresult import counted
from .charts import Chart, Figure, figure, run_colour, run_marker
from .scale import Scale

if TYPE_CHECKING:
    from ..fitting.heldout import HeldOut
    from ..fitting.result import FitResult
    from ..model.model import HarmonicModel
    from ..runs.run import CalibrationRun

__all__ = ["before_after", "errors_of_runs", "residuals", "signals_present", "turn"]

Array = NDArray[np.float64]

#: Readings drawn in one chart at most: more do not show, and make the page heavy and slow.
_MOST_POINTS: Final = 2_000
#: Runs up to which as many are drawn; of more, whose tables are long, fewer: a page weighs 1 MB.
_MOST_RUNS: Final = 12
#: Readings drawn of each run at least.
_FEWEST: Final = 6
#: Runs named in the legends; the table of runs has the symbols of all.
_MOST_IN_LEGEND: Final = 4
#: Size of the dots, and of those of few readings, which would be lost.
_DOT, _LARGE_DOT = 4.0, 6.0
#: Readings of all runs up to which dots are large.
_FEW: Final = 600
#: Periods of the stretch that is shown beside an envelope.
_PERIODS: Final = 4.0
#: Ticks of that narrow chart.
_STRETCH_TICKS: Final = 4.0


def run_dots(
    chart: Chart, number: int, points: Points, runs: int, scale: Scale,
    *, size: float = _DOT, zoomed: bool = False,
) -> None:  # fmt: skip
    """Readings of one run, in the unit of the page or another signal's."""
    part = points if zoomed else curves.thinned(points, dots_of_run(runs), number)
    chart.dots(
        part.x,
        part.y,
        colour=run_colour(number),
        marker=run_marker(number),
        size=size,
        run=number,
        # The table of runs has their symbols; a long legend would leave no picture.
        label=f"run {points.label}" if runs <= _MOST_IN_LEGEND and not zoomed else "",
        hover=f"run {points.label}: {scale.read} at @x{{0.00}}°",
    )


def dots_of_run(runs: int, most: int = _MOST_POINTS) -> int:
    """Readings drawn of each of so many runs, of ``most`` in all where runs are few."""
    return max(_FEWEST, int(most * min(1.0, _MOST_RUNS / runs) / runs))


def dot_size(readings: int) -> float:
    """Size of the dots of so many readings."""
    return _LARGE_DOT if readings <= _FEW else _DOT


def turn(model: HarmonicModel | None) -> tuple[float, float]:
    """The turn in degrees, or the part of it that the model has seen."""
    return (0.0, 360.0) if model is None else curves.seen_span(model)


def errors_of_runs(
    fit: FitResult | None, runs: Sequence[CalibrationRun], measured: list[Points], scale: Scale
) -> Figure:
    """Measured error of every run with the model and its band.

    A model with gear orders would be a black surface: it is drawn as the envelope of its
    curve, and a stretch of a few periods beside it shows the curve itself.
    """
    low, high = curves.travelled(runs) if fit is None else turn(fit.model)
    everything = [scale.points(points) for points in measured]
    y = f"error less the run's zero / {scale.name}"
    strong = (
        None if fit is None else curves.strong_gear_order(fit.orders, fit.amplitudes, high - low)
    )
    main = Chart("reference angle / deg", y, x_range=(low, high), grow=2.0)
    main.angle_axis(low, high)
    charts = [main]
    if fit is not None:
        curve = scale.curve(curves.model_curve(fit.model))
        if strong is not None:
            places, least, most = curves.envelope(curve)
            main.band(places, least, most, colour="model", label="envelope of the model")
        else:
            _draw_model(main, curve)
    size = dot_size(sum(len(run) for run in runs))
    for i, points in enumerate(everything):
        run_dots(main, i, points, len(runs), scale, size=size)
    if fit is not None and strong is not None:
        charts.append(_stretch(fit, strong, everything, y, scale))
    what = "the fitted model with its 95 % band" if fit is not None else "no model"
    alt = f"Measured error in {scale.name} over one turn for {counted(runs, 'run')}, with {what}"
    alt += "; a short segment is shown larger beside it." if strong else "."
    return figure(alt, charts)


def _draw_model(chart: Chart, curve: Curve, label: str = "model") -> None:
    if curve.std is not None:
        half = CONFIDENCE * curve.std
        chart.band(
            curve.angle, curve.error - half, curve.error + half, colour="model", label="95 % band"
        )
    chart.line(curve.angle, curve.error, colour="model", label=label)


def stretch_chart(order: float, low: float, high: float, y: str, **given: Any) -> Chart:
    """An empty chart of a few periods of an order, in the middle: both ends may be thin."""
    width = min(_PERIODS * 360.0 / order, high - low)
    start = 0.5 * (low + high) - 0.5 * width
    title = f"A segment of {width:.3g}°: {_PERIODS:g} periods of order {order:g}"
    chart = Chart("reference angle / deg", y, x_range=(start, start + width), title=title, **given)
    chart.angle_axis(start, start + width, _STRETCH_TICKS)
    return chart


def _stretch(fit: FitResult, order: float, everything: list[Points], y: str, scale: Scale) -> Chart:
    """A few periods of the strongest gear order, as large as they are."""
    chart = stretch_chart(order, *turn(fit.model), y)
    start, end = chart.x_range
    _draw_model(chart, scale.curve(curves.model_curve(fit.model, (start, end))), "model there")
    for i, points in enumerate(everything):
        part = within(points, start, end)
        run_dots(chart, i, part, len(everything), scale, size=6.0, zoomed=True)
    return chart


def within(points: Points, low: float, high: float) -> Points:
    """The readings between two angles."""
    inside = (points.x >= low) & (points.x <= high)
    return Points(points.label, points.x[inside], points.y[inside])


def before_after(held: HeldOut, runs: Sequence[CalibrationRun], scale: Scale) -> Figure:
    """Error of every held-out run before and after correction."""
    model = next((run.model for run in held.runs if run.model is not None), None)
    low, high = turn(model)
    y = f"error of held-out runs / {scale.name}"
    chart = Chart("reference angle / deg", y, x_range=(low, high))
    chart.angle_axis(low, high)
    most = dots_of_run(len(held.runs), _MOST_POINTS // 2)
    size = dot_size(sum(len(run) for run in runs))
    for name, marker in (("before", "square"), ("after", "circle")):
        for run in held.runs:
            first = 0.0 if run.model is None else curves.seen_span(run.model)[0]
            points = Points(run.label, curves.degrees(run.run, first), getattr(run, name))
            index = next(i for i, known in enumerate(runs) if known is run.run)
            part = curves.thinned(scale.points(points), most, index)
            chart.dots(
                part.x,
                part.y,
                colour=name,
                marker=marker,
                size=size,
                run=index,
                label=name,
                hover=f"run {run.label}, {name}: {scale.read} at @x{{0.00}}°",
            )
    alt = (
        f"Error of {len(held.runs)} runs over one turn before and after correction by a model "
        "that was fitted without them."
    )
    return figure(alt, [chart])


def signals_present(fit: FitResult) -> list[curves.Signal]:
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


def residuals(fit: FitResult, against: curves.Signal, scale: Scale) -> Figure:
    """What the model leaves, against one signal."""
    points = [scale.points(part) for part in curves.residual_points(fit, against)]
    by_label = {(run.label or str(i + 1)): i for i, run in enumerate(fit.runs)}
    x_range = {"angle": turn(fit.model), "direction": (-1.5, 1.5)}.get(against)
    chart = Chart(curves.SIGNALS[against], f"residual / {scale.name}", x_range=x_range)
    if against == "angle":
        chart.angle_axis(*turn(fit.model))
    if against == "direction":
        chart.whole_axis(-1.0, 1.0, 3)
    size = dot_size(sum(part.y.size for part in points))
    for part in points:
        number = by_label[part.label]
        drawn = _beside(part, number, len(points)) if against == "direction" else part
        run_dots(chart, number, drawn, len(points), scale, size=size)
    alt = (
        f"Residual of the fitted model in {scale.name} against {against}, {counted(points, 'run')}."
    )
    return figure(alt, [chart])


def _beside(points: Points, number: int, runs: int) -> Points:
    """Readings of the same direction, the runs next to each other instead of on one line."""
    shift = 0.8 * ((number + 0.5) / runs - 0.5)
    return Points(points.label, points.x + shift, points.y)
