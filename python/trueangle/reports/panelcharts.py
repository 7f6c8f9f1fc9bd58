"""A described panel of readings as a chart of the report."""

from __future__ import annotations

from typing import Final

from ..plots.curves import CONFIDENCE, Curve, curve_envelope, thinned_points
from ..plots.panel import ANGLE, Cloud, Panel, PanelPicture
from .charts import Chart, Figure, chart_figure, chart_run_marker, css_run_colour
from .scale import ErrorScale

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
#: Ticks of a segment, whose chart is narrow, and of a whole turn.
_TICKS = {True: 4.0, False: 9.0}


def panel_figure(
    picture: PanelPicture, scale: ErrorScale, arrangement: str = "row", **given: float
) -> Figure:
    """All panels of a picture; the main one is twice as wide as its segment."""
    grows = [2.0 if number == 0 else 1.0 for number in range(len(picture.panels))]
    charts = [
        _panel_chart(panel, scale, grow=grow, **given)
        for panel, grow in zip(picture.panels, grows, strict=True)
    ]
    segments = [panel.title for panel in picture.panels if panel.title]
    more = "".join(f" {title} stand beside it." for title in segments)
    return chart_figure(picture.told + more, charts, arrangement)


def _panel_chart(panel: Panel, scale: ErrorScale, **given: float) -> Chart:
    """Readings, model and medians of a panel."""
    segment = bool(panel.title)
    chart = Chart(panel.x, panel.y, x_range=panel.span, title=panel.title, **given)  # type: ignore[arg-type]
    if panel.angles and panel.span is not None:
        chart.angle_axis(*panel.span, _TICKS[segment])
    elif panel.span is not None:
        chart.whole_axis(-1.0, 1.0, 3)  # directions
    if panel.model is not None and panel.dense:
        chart.band(*curve_envelope(panel.model), colour="model", label="envelope of the model")
    elif panel.model is not None:
        _draw_model(chart, panel.model, "model there" if segment else "model")
    runs = len({cloud.run for cloud in panel.clouds})
    roles = len({cloud.role for cloud in panel.clouds})
    few = panel.readings <= _FEW * roles
    most = dots_of_run(runs, _MOST_POINTS // roles)
    for cloud in panel.clouds:
        _draw_cloud(chart, cloud, panel, scale, None if segment else most, few or segment)
    if panel.medians is not None:
        chart.line(*panel.medians, colour="fore", label="median", width=2.0)
    return chart


def dots_of_run(runs: int, most: int = _MOST_POINTS) -> int:
    """Readings drawn of each of so many runs, of ``most`` in all where runs are few."""
    return max(_FEWEST, int(most * min(1.0, _MOST_RUNS / runs) / runs))


def _draw_cloud(
    chart: Chart, cloud: Cloud, panel: Panel, scale: ErrorScale, most: int | None, large: bool
) -> None:
    part = cloud.points if most is None else thinned_points(cloud.points, most, cloud.run)
    size = _LARGE_DOT if large else _DOT
    colour, marker, hollow = {
        "run": (css_run_colour(cloud.run), chart_run_marker(cloud.run), False),
        "before": ("before", "square", False),
        "after": ("after", "circle", False),
        "measured": ("before", "circle", True),
        "simulated": ("model", "circle", False),
    }[cloud.role]
    size *= {"measured": 1.5, "simulated": 0.6}.get(cloud.role, 1.0)
    label = f"run {cloud.points.label}" + ("" if cloud.role == "run" else f", {cloud.role}")
    # The table of runs has their symbols; a long legend would leave no picture.
    long = cloud.role == "run" and len(panel.clouds) > _MOST_IN_LEGEND
    chart.dots(
        part.x,
        part.y,
        colour=colour,
        marker=marker,
        size=size,
        run=cloud.run,
        label="" if long or panel.title else cloud.name,
        hover=f"{label}: {scale.read}{_at(panel.x)}",
        hollow=hollow,
    )


def _at(title: str) -> str:
    """Where a reading stands, as it is shown over it."""
    if title == ANGLE:
        return " at @x{0.00}°"
    _, slash, unit = title.partition(" / ")
    return f" at @x{{0.00}} {unit.strip('()')}" if slash else ""


def _draw_model(chart: Chart, curve: Curve, label: str) -> None:
    if curve.std is not None:
        half = CONFIDENCE * curve.std
        chart.band(
            curve.angle, curve.error - half, curve.error + half, colour="model", label="95 % band"
        )
    chart.line(curve.angle, curve.error, colour="model", label=label)
