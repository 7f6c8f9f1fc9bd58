"""Pictures of readings as panels: errors, before and after, residuals, simulated; draws nothing.

A picture is described once and plotted by `trueangle.plots.drawnreadings`, for a figure and for
a page.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

import numpy as np

from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, wrap
from ..support.arrays import Array
from ..support.display_units import ErrorUnit, significant_digits
from ..support.layout import counted
from . import curves
from .curves import ModelCurve, Points, Signal

if TYPE_CHECKING:
    from ..fitting.result import FitResult
    from ..simulation import Simulation


#: What the colour of readings represents: their run, or what was done to them.
_Role: TypeAlias = Literal["run", "before", "after", "measured", "simulated"]

#: Title of an axis of angles.
ANGLE: Final = "reference angle / deg"

#: Periods of the segment that is shown next to an envelope.
_PERIODS: Final = 4.0
#: Bins of a running median, and the readings that make it worth its line.
_BINS, _ENOUGH = 36, 360


@dataclass(frozen=True)
class Cloud:
    """Readings of one run as dots.

    Attributes
    ----------
    points : Points
        Errors in the unit of the picture.
    run : int
        Number of the run, from 0.
    role : {"run", "before", "after", "measured", "simulated"}
    name : str
        For the legend, which has each name once.
    """

    points: Points
    run: int
    role: _Role = "run"
    name: str = ""


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    x, y : str
        Titles of the axes, with units.
    clouds : tuple of Cloud
    span : (float, float), optional
        What the x axis shows; by default what the readings cover.
    angles : bool
        The x axis has ticks at whole parts of a turn.
    model : ModelCurve, optional
        In the unit of the picture; ``dense`` where only its envelope can be plotted.
    medians : (ndarray, ndarray), optional
        Places and medians of the readings about them.
    zero : bool
        A line marks no error.
    title : str
        Of a segment that is shown larger.
    """

    x: str
    y: str
    clouds: tuple[Cloud, ...]
    span: tuple[float, float] | None = None
    angles: bool = True
    model: ModelCurve | None = None
    dense: bool = False
    medians: tuple[Array, Array] | None = None
    zero: bool = False
    title: str = ""


@dataclass(frozen=True)
class PanelPicture:
    """Panels, the main one first, and a sentence for who does not see them."""

    panels: tuple[Panel, ...]
    told: str


def _magnified_segment(whole: Panel, order: float, model: ModelCurve | None = None) -> Panel:
    """A few periods of an order as large as they are, in the middle: both ends may be thin."""
    low, high = _segment_span(whole, order)
    clouds = []
    for cloud in whole.clouds:
        points = cloud.points
        inside = (points.x >= low) & (points.x <= high)
        part = Points(points.label, points.x[inside], points.y[inside])
        clouds.append(replace(cloud, points=part))
    return replace(
        whole,
        clouds=tuple(clouds),
        span=(low, high),
        model=model,
        dense=False,
        title=f"A segment of {high - low:.3g}°: {_PERIODS:g} periods of order {order:g}",
    )


def _segment_span(whole: Panel, order: float) -> tuple[float, float]:
    """First and last angle of `_magnified_segment`."""
    assert whole.span is not None
    low, high = whole.span
    half = 0.5 * min(_PERIODS * 360.0 / order, high - low)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def _binned_medians(parts: Sequence[Points]) -> tuple[Array, Array] | None:
    """Medians of readings in bins of x; None of few readings."""
    x = np.concatenate([part.x for part in parts])
    y = np.concatenate([part.y for part in parts])
    low, high = float(x.min()), float(x.max())
    if x.size < _ENOUGH or high <= low:
        return None
    edges = np.linspace(low, high, _BINS + 1)
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    filled = [b for b in range(_BINS) if np.count_nonzero(index == b) >= _ENOUGH // _BINS // 2]
    return (
        np.array([float(x[index == b].mean()) for b in filled]),
        np.array([float(np.median(y[index == b])) for b in filled]),
    )


def errors_picture(
    runs: Sequence[CalibrationRun], fit: FitResult | None, unit: ErrorUnit
) -> PanelPicture:
    """Error of every run less that run's zero, with the fitted model where there is one.

    A model with gear orders would be a black surface: its envelope is plotted, and a segment
    of a few periods shows the curve itself.
    """
    parts = _measured(runs) if fit is None else curves.error_points(fit)
    clouds = tuple(_of_runs(parts, unit))
    y = f"error less the run's zero / {unit.name}"
    about = f"Error of {counted(runs, 'run')} over the angle"
    if fit is None:
        size = significant_digits(max(float(np.ptp(cloud.points.y)) for cloud in clouds), 3)
        told = f"{about}, without a model: up to {size} {unit.name} peak-to-peak."
        return PanelPicture((Panel(ANGLE, y, clouds, curves.travelled_degrees(runs)),), told)
    low, high = span = curves.fitted_degrees(fit.model)
    strong = curves.strong_gear_order(fit.orders, fit.amplitudes, high - low)
    model = curves.model_curve(fit.model).scaled(unit.per_arcsec)
    whole = Panel(ANGLE, y, clouds, span, model=model, dense=strong is not None)
    told = (
        f"{about} and the fitted model, which spans "
        f"{significant_digits(float(np.ptp(model.error)), 3)} "
        f"{unit.name} peak-to-peak in {counted(len(fit.orders), 'order')}."
    )
    if strong is None:
        return PanelPicture((whole,), told)
    near = curves.model_curve(fit.model, _segment_span(whole, strong)).scaled(unit.per_arcsec)
    return PanelPicture((whole, _magnified_segment(whole, strong, near)), told)


def _measured(runs: Sequence[CalibrationRun]) -> list[Points]:
    """Readings where there is no model, on the turn that begins where the travel does."""
    low, _ = curves.travelled_degrees(runs)
    found = []
    for number, run in enumerate(runs):
        error = wrap(run.indicated - run.reference - run.zero, run.period)
        error *= ARCSEC_PER_TURN / run.period
        found.append(
            Points(curves.run_label(run, number), curves.reference_degrees(run, low), error)
        )
    return found


def _of_runs(parts: Iterable[Points], unit: ErrorUnit) -> Iterable[Cloud]:
    """A cloud of each run, in the colours of the runs."""
    for number, part in enumerate(parts):
        yield Cloud(part.scaled(unit.per_arcsec), number, name=f"run {part.label}")


def before_after_picture(
    pairs: Sequence[tuple[int, Points, Points]], span: tuple[float, float], unit: ErrorUnit
) -> PanelPicture:
    """Held-out readings before and after correction: number of the run and both, in arcsec."""
    clouds: list[Cloud] = []
    told = []
    for place, role in ((1, "before"), (2, "after")):
        parts = [(pair[0], pair[place].scaled(unit.per_arcsec)) for pair in pairs]  # type: ignore[union-attr]
        y = np.concatenate([part.y for _, part in parts])
        rms, ptp = (
            significant_digits(float(np.sqrt(np.mean(y * y)))),
            significant_digits(float(np.ptp(y))),
        )
        name = f"{role}: rms {rms}, peak-to-peak {ptp} {unit.name}"
        clouds += [Cloud(part, number, role, name) for number, part in parts]  # type: ignore[arg-type]
        told.append(f"{role} correction rms {rms}, peak-to-peak {ptp} {unit.name}")
    label = f"error of held-out runs / {unit.name}"
    panel = Panel(ANGLE, label, tuple(clouds), span, zero=True)
    return PanelPicture((panel,), f"Error of {counted(pairs, 'held-out run')}: {'; '.join(told)}.")


def residual_picture(fit: FitResult, against: Signal, unit: ErrorUnit) -> PanelPicture:
    """What the model leaves of every reading, against a signal that it may depend on.

    Raises
    ------
    ArgumentError
        An unknown signal, or one that no run has.
    """
    parts = curves.residual_points(fit, against)
    numbers = {curves.run_label(run, number): number for number, run in enumerate(fit.runs)}
    if against == "direction":
        # Runs of one direction next to each other instead of on one line.
        # Part of the way between two directions over which the runs are next to each other.
        shift = 0.8 * ((np.arange(len(parts)) + 0.5) / len(parts) - 0.5)
        parts = [Points(p.label, p.x + s, p.y) for p, s in zip(parts, shift, strict=True)]
    scaled = [part.scaled(unit.per_arcsec) for part in parts]
    span = {"angle": curves.fitted_degrees(fit.model), "direction": (-1.5, 1.5)}.get(against)
    panel = Panel(
        curves.SIGNALS[against],
        f"residual / {unit.name}",
        tuple(Cloud(p, numbers[p.label], name=f"run {p.label}") for p in scaled),
        span,
        angles=against == "angle",
        medians=_binned_medians(scaled),
        zero=True,
    )
    rest = np.concatenate([part.y for part in scaled])
    told = (
        f"What the model leaves of {rest.size} readings against {against}: "
        f"{significant_digits(float(np.sqrt(np.mean(rest * rest))), 3)} {unit.name} rms."
    )
    return PanelPicture((panel,), told)


def comparison_picture(
    expected: Sequence[tuple[Points, Points]],
    unit: ErrorUnit,
    known: Simulation | None = None,
) -> PanelPicture:
    """Measured and simulated error of every run, and last their difference.

    Where the gear orders of a simulation ``known`` fill the picture, a segment of a few periods
    is between the two.
    """
    factor = unit.per_arcsec
    both: list[Cloud] = []
    rest = []
    for number, (measured, simulated) in enumerate(expected):
        both.append(Cloud(measured.scaled(factor), number, "measured", "measured"))
        both.append(Cloud(simulated.scaled(factor), number, "simulated", "simulated"))
        left = factor * (measured.y - simulated.y)
        rest.append(Cloud(Points(measured.label, measured.x, left), number))
    low = min(float(cloud.points.x.min()) for cloud in rest)
    high = max(float(cloud.points.x.max()) for cloud in rest)
    # Part of a turn in degrees from which on the axis shows a whole one.
    span = (0.0, 360.0) if high - low > 300.0 else (low, high)
    whole = Panel(ANGLE, f"error / {unit.name}", tuple(both), span)
    panels = [whole]
    if known is not None and (strong := _gear_order(known, span[1] - span[0])) is not None:
        panels.append(_magnified_segment(whole, strong))
    panels.append(Panel(ANGLE, f"difference / {unit.name}", tuple(rest), span, zero=True))
    deviation = float(np.concatenate([cloud.points.y for cloud in rest]).std())
    told = (
        f"Measured and simulated error of {counted(expected, 'run')} over the angle; they differ "
        f"by {significant_digits(deviation, 3)} {unit.name} rms."
    )
    return PanelPicture(tuple(panels), told)


def _gear_order(known: Simulation, span: float) -> float | None:
    """The order of a simulation whose periods fill a picture of ``span`` degrees."""
    lines = known.harmonics
    orders = [known.joint.output_order(line.shaft, line.order) for line in lines]
    return curves.strong_gear_order(orders, [line.amplitude_arcsec for line in lines], span)
