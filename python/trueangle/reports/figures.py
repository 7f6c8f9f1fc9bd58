"""Figures of readings over the angle: errors, before and after, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..plots import curves
from ..plots.curves import Points
from ..plots.readingpictures import before_after_picture, errors_picture, residual_picture
from .charts import Figure
from .panelcharts import figure_of
from .scale import Scale

if TYPE_CHECKING:
    from ..fitting.heldout import HeldOut
    from ..fitting.result import FitResult
    from ..runs.run import CalibrationRun

__all__ = ["before_after", "errors_of_runs", "residuals", "signals_present"]

Array = NDArray[np.float64]


def errors_of_runs(fit: FitResult | None, runs: Sequence[CalibrationRun], scale: Scale) -> Figure:
    """Measured error of every run with the model and its band."""
    return figure_of(errors_picture(runs, fit, scale.unit), scale)


def before_after(held: HeldOut, runs: Sequence[CalibrationRun], scale: Scale) -> Figure:
    """Error of every held-out run before and after correction."""
    pairs = []
    for run in held.runs:
        low = 0.0 if run.model is None else curves.seen_span(run.model)[0]
        x = curves.degrees(run.run, low)
        number = next(i for i, known in enumerate(runs) if known is run.run)
        pairs.append((number, Points(run.label, x, run.before), Points(run.label, x, run.after)))
    model = next((run.model for run in held.runs if run.model is not None), None)
    span = (0.0, 360.0) if model is None else curves.seen_span(model)
    return figure_of(before_after_picture(pairs, span, scale.unit), scale)


def residuals(fit: FitResult, against: curves.Signal, scale: Scale) -> Figure:
    """What the model leaves, against one signal."""
    return figure_of(residual_picture(fit, against, scale.unit), scale)


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
