"""Interactive figures of the report as plain plotly specifications.

Traces of one run carry ``meta.run``: the page shows and hides a run in all figures at
once. Colours come from the page (light, dark, print), which knows traces by ``meta.role``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from ..angles import ARCSEC_PER_TURN
from ..errors import RankError
from ..plots import curves, palette
from ..plots.amplitudespectrum import likely_aliases, thresholds
from ..plots.curves import CONFIDENCE, Points

if TYPE_CHECKING:
    from ..fitting.heldout import HeldOut
    from ..fitting.result import FitResult
    from ..model import HarmonicModel
    from ..orders.select import OrderSelection
    from ..runs import CalibrationRun

__all__ = [
    "before_after",
    "errors_of_runs",
    "phases",
    "residuals",
    "signals_present",
    "spectrum",
    "swatch",
]

Array = NDArray[np.float64]
Figure = dict[str, Any]

#: Readings drawn in one figure at most: more do not show, and make the page slow.
_MOST_POINTS: Final = 8_000
#: Runs named in the legends.
_MOST_IN_LEGEND: Final = 4
_SYMBOLS: Final = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross")
_GLYPHS: Final = ("●", "■", "▲", "◆", "▼", "✚")


def figure(alt: str, x: str, y: str, traces: Sequence[dict[str, Any]], **layout: Any) -> Figure:
    """One figure: alternative text, axis titles, traces and further layout."""
    return {
        "alt": alt,
        "data": list(traces),
        "layout": {"xaxis": {"title": {"text": x}}, "yaxis": {"title": {"text": y}}} | layout,
    }


def run_trace(number: int, points: Points, runs: int) -> dict[str, Any]:
    """Readings of one run as dots."""
    part = curves.thinned(points, max(50, _MOST_POINTS // runs))
    return {
        "type": "scatter",
        "mode": "markers",
        "name": f"run {points.label}",
        "x": rounded(part.x, 4),
        "y": rounded(part.y, 3),
        "marker": {
            "size": 4,
            "color": palette.run_colour(number),
            "symbol": _SYMBOLS[number % len(_SYMBOLS)],
            "opacity": 0.75,
        },
        "meta": {"run": number},
        # The table of runs has their symbols; a long legend would leave no picture.
        "showlegend": runs <= _MOST_IN_LEGEND,
    }


def swatch(number: int) -> tuple[str, str]:
    """Colour and symbol of a run, for the table of runs."""
    return palette.run_colour(number), _GLYPHS[number % len(_GLYPHS)]


def turn_axis(model: HarmonicModel | None) -> dict[str, Any]:
    """Axis of the reference angle: the turn, or the part of it that the model has seen."""
    low, high = (0.0, 360.0) if model is None else curves.seen_span(model)
    return {
        "title": {"text": "reference angle / deg"},
        "range": [low, high],
        "dtick": 45 if high - low > 180.0 else None,
    }


def rounded(values: Array, digits: int) -> list[float]:
    """For drawing only: numbers on the page come from the content."""
    return [float(v) for v in np.round(values, digits)]


def errors_of_runs(
    fit: FitResult | None, runs: Sequence[CalibrationRun], everything: list[Points]
) -> Figure:
    """Measured error of every run with the model and its band."""
    traces: list[dict[str, Any]] = []
    if fit is not None:
        curve = curves.model_curve(fit.model)
        x = rounded(curve.angle, 3)
        if curve.std is not None:
            half = CONFIDENCE * curve.std
            traces.append(
                {
                    "type": "scatter",
                    "x": x + x[::-1],
                    "y": rounded(curve.error + half, 3) + rounded(curve.error - half, 3)[::-1],
                    "fill": "toself",
                    "line": {"width": 0},
                    "hoverinfo": "skip",
                    "name": "95 % band",
                    "meta": {"role": "band"},
                }
            )
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": x,
                "y": rounded(curve.error, 3),
                "line": {"width": 1.2 if max(fit.orders, default=0.0) < 40 else 0.6},
                "name": "model",
                "meta": {"role": "model"},
            }
        )
    traces += [run_trace(i, p, len(runs)) for i, p in enumerate(everything)]
    what = "the fitted model with its 95 % band" if fit is not None else "no model"
    alt = f"Measured error in arcsec over one turn for {len(runs)} run(s), with {what}."
    x_axis = turn_axis(None if fit is None else fit.model)
    return figure(alt, "", "error less the run's zero / arcsec", traces, xaxis=x_axis)


def spectrum(fit: FitResult | None, selection: OrderSelection | None) -> Figure:
    """Amplitude of every order: candidates of a selection, or the orders of a fit."""
    x_title = "order / cycles per output turn"
    if selection is None:
        assert fit is not None
        factor = ARCSEC_PER_TURN / fit.model.period
        ranks = np.argsort(fit.orders)
        trace = {
            "type": "bar",
            "name": "fitted amplitude",
            "x": [f"{fit.orders[i]:g}" for i in ranks],
            "y": rounded(factor * fit.amplitudes[ranks], 3),
            "hovertemplate": "order %{x}: %{y:.2f} arcsec<extra></extra>",
            "marker": {"color": palette.AFTER},
        }
        if fit.model.covariance is not None:
            half = CONFIDENCE * factor * fit.amplitude_std[ranks]
            trace["error_y"] = {"type": "data", "array": rounded(half, 4)}
        alt = f"Amplitudes in arcsec of {len(ranks)} fitted orders with 95 % intervals."
        return figure(alt, x_title, "amplitude / arcsec", [trace], **_categories(len(ranks)))
    factor = ARCSEC_PER_TURN / selection.period
    traces = []
    for kept, name in ((True, "retained"), (False, "not retained")):
        rows = [row for row in selection.table if row.retained is kept]
        if not rows:
            continue
        traces.append(
            {
                "type": "bar",
                "name": name,
                "x": [f"{row.order:g}" for row in rows],
                "y": rounded(np.array([factor * row.amplitude for row in rows]), 3),
                "text": [_hover(row) for row in rows],
                "textposition": "none",
                "hovertemplate": "order %{x}: %{y:.2f} arcsec<br>%{text}<extra></extra>",
                "marker": {"color": palette.AFTER if kept else "rgba(140,140,140,0.35)"},
            }
        )
    names = [f"{row.order:g}" for row in selection.table]
    limit = factor * thresholds(selection)
    traces.append(
        {
            "type": "scatter",
            "mode": "markers",
            "name": "needed to be significant",
            "x": names,
            "y": rounded(np.nan_to_num(limit), 3),
            "marker": {"symbol": "line-ew-open", "size": 12, "color": palette.WARNING},
            "hovertemplate": "order %{x}: %{y:.2f} arcsec needed<extra></extra>",
        }
    )
    kept_orders = ", ".join(f"{m:g}" for m in selection.orders) or "none"
    alt = (
        f"Amplitude of {len(names)} candidate orders in arcsec with the threshold of "
        f"significance. Retained: {kept_orders}."
    )
    order = {"categoryorder": "array", "categoryarray": names}
    layout = _categories(len(names))
    layout["xaxis"] = {"title": {"text": x_title}, "type": "category"} | order
    return figure(alt, x_title, "amplitude / arcsec", traces, **layout)


def _hover(row: Any) -> str:
    lines = [row.verdict]
    if row.aliases:
        lines.append("looks like order " + ", ".join(f"{m:g}" for m in likely_aliases(row)[:4]))
    lines += [str(e) for e in row.explanations[:3]]
    return "<br>".join(lines)


def _categories(count: int) -> dict[str, Any]:
    axis = {"title": {"text": "order / cycles per output turn"}, "type": "category"}
    return {"xaxis": axis, "barmode": "overlay", "bargap": 0.25 if count < 60 else 0.1}


def phases(fit: FitResult) -> Figure | None:
    """Phase and amplitude of every order in every run; None where no run holds them."""
    try:
        found = sorted(curves.run_phases(fit), key=lambda p: -float(p.amplitude.mean()))[:12]
    except RankError:
        return None
    traces = [
        {
            "type": "scatterpolar",
            "mode": "markers",
            "name": f"order {p.order:g}",
            "theta": rounded(np.degrees(p.phase) % 360.0, 2),
            "r": rounded(p.amplitude, 3),
            "text": [f"run {label}" for label in p.labels],
            "hovertemplate": "%{text}: %{r:.2f} arcsec at %{theta:.1f}°",
            "marker": {
                "size": 8,
                "color": palette.run_colour(i),
                "symbol": _SYMBOLS[(i + i // len(palette.RUNS)) % len(_SYMBOLS)],
            },
        }
        for i, p in enumerate(sorted(found, key=lambda p: p.order))
    ]
    alt = (
        f"Polar picture of {len(traces)} orders: phase as the angle, amplitude in arcsec as the "
        "radius, one dot per run. Dots of one order close together are a systematic error."
    )
    polar = {"radialaxis": {"angle": 112.5, "nticks": 5, "tickangle": 0, "rangemode": "tozero"}}
    return {"alt": alt, "data": traces, "layout": {"polar": polar}}


def before_after(held: HeldOut, runs: Sequence[CalibrationRun]) -> Figure:
    """Error of every held-out run before and after correction."""
    traces = []
    for name, colour, symbol in (
        ("before", palette.BEFORE, "square"),
        ("after", palette.AFTER, "circle"),
    ):
        for number, run in enumerate(held.runs):
            low = 0.0 if run.model is None else curves.seen_span(run.model)[0]
            points = Points(run.label, curves.degrees(run.run, low), getattr(run, name))
            index = next(i for i, known in enumerate(runs) if known is run.run)
            trace = run_trace(index, points, 2 * len(held.runs))
            trace |= {"name": name, "legendgroup": name, "showlegend": number == 0}
            trace["marker"] = {"size": 4, "color": colour, "symbol": symbol, "opacity": 0.75}
            trace["hovertemplate"] = f"run {run.label}, {name}: %{{y:.2f}} arcsec at %{{x:.2f}}°"
            trace["hovertemplate"] += "<extra></extra>"
            traces.append(trace)
    alt = (
        f"Error of {len(held.runs)} runs over one turn before and after correction by a model "
        "that was fitted without them."
    )
    model = next((run.model for run in held.runs if run.model is not None), None)
    return figure(alt, "", "error of held-out runs / arcsec", traces, xaxis=turn_axis(model))


def signals_present(fit: FitResult) -> list[str]:
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


def residuals(fit: FitResult, against: str) -> Figure:
    """What the model leaves, against one signal."""
    points = curves.residual_points(fit, against)
    by_label = {(run.label or str(i + 1)): i for i, run in enumerate(fit.runs)}
    traces = [run_trace(by_label[p.label], p, len(points)) for p in points]
    if against == "direction":
        for trace in traces:
            trace["type"] = "box"
            trace["boxpoints"] = False
            del trace["mode"]
    alt = f"Residual of the fitted model in arcsec against {against}, {len(points)} run(s)."
    more = {"xaxis": turn_axis(fit.model)} if against == "angle" else {}
    return figure(alt, curves.SIGNALS[against], "residual / arcsec", traces, **more)
