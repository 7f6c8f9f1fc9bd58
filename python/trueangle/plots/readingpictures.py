"""Pictures of readings: errors, before and after, residuals, measured and simulated; described."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, wrap
from ..support.display_units import ErrorUnit, significant_digits
from ..support.layout import counted
from . import curves
from .curves import Points, Signal
from .panel import (
    ANGLE,
    Cloud,
    Panel,
    PanelPicture,
    binned_medians,
    magnified_segment,
    segment_span,
)

if TYPE_CHECKING:
    from ..fitting.result import FitResult
    from ..simulation import Simulation

#: Part of a turn in degrees from which on the axis shows a whole one.
_MOST_OF_A_TURN: Final = 300.0
#: Part of the way between two directions over which the runs stand beside each other.
_BESIDE: Final = 0.8


def errors_picture(
    runs: Sequence[CalibrationRun], fit: FitResult | None, unit: ErrorUnit
) -> PanelPicture:
    """Error of every run less that run's zero, with the fitted model where there is one.

    A model with gear orders would be a black surface: its envelope is drawn, and a segment
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
    near = curves.model_curve(fit.model, segment_span(whole, strong)).scaled(unit.per_arcsec)
    return PanelPicture((whole, magnified_segment(whole, strong, near)), told)


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
        shift = _BESIDE * ((np.arange(len(parts)) + 0.5) / len(parts) - 0.5)
        parts = [Points(p.label, p.x + s, p.y) for p, s in zip(parts, shift, strict=True)]
    scaled = [part.scaled(unit.per_arcsec) for part in parts]
    span = {"angle": curves.fitted_degrees(fit.model), "direction": (-1.5, 1.5)}.get(against)
    panel = Panel(
        curves.SIGNALS[against],
        f"residual / {unit.name}",
        tuple(Cloud(p, numbers[p.label], name=f"run {p.label}") for p in scaled),
        span,
        angles=against == "angle",
        medians=binned_medians(scaled),
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
    stands between the two.
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
    span = (0.0, 360.0) if high - low > _MOST_OF_A_TURN else (low, high)
    whole = Panel(ANGLE, f"error / {unit.name}", tuple(both), span)
    panels = [whole]
    if known is not None and (strong := _gear_order(known, span[1] - span[0])) is not None:
        panels.append(magnified_segment(whole, strong))
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
