"""What the pictures show, as points and curves in degrees and arcsec; draws nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

import numpy as np

from ..errors import ArgumentError
from ..fitting.heldout import correct_held_out
from ..model.model import HarmonicModel
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, wrap
from ..support.arrays import Array
from ..support.display_units import sine_of_rms
from ..support.suggestions import check_choice

if TYPE_CHECKING:
    from ..fitting.result import FitResult

#: Half width of a 95 % band in standard deviations.
CONFIDENCE: Final = 1.96

#: Multiples of the golden section modulo one are evenly spread, however many there are.
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)

#: Points of a curve for each cycle of its highest order, and the least and most of them.
_PER_CYCLE, _FEWEST, _MOST_SAMPLES = 20, 361, 12001


#: Places of an envelope.
_PLACES: Final = 180

#: What residuals can be plotted against...
Signal: TypeAlias = Literal["angle", "time", "speed", "temperature", "direction", "torque"]
#: ... and axis label by name.
SIGNALS: Final[dict[Signal, str]] = {
    "angle": "reference angle / deg",
    "time": "time / s",
    "speed": "output speed / (deg/s)",
    "temperature": "temperature / °C",
    "direction": "direction of travel",
    "torque": "torque / Nm",
}


@dataclass(frozen=True)
class Points:
    """Readings of one run: ``x`` (degrees unless it is another signal), ``y`` in arcsec."""

    label: str
    x: Array
    y: Array

    def scaled(self, factor: float) -> Points:
        """The readings with their errors in another unit."""
        return Points(self.label, self.x, factor * self.y)


@dataclass(frozen=True)
class ModelCurve:
    """A model over the angle in degrees: error and its standard deviation in arcsec."""

    angle: Array
    error: Array
    std: Array | None

    def scaled(self, factor: float) -> ModelCurve:
        """The model with its errors in another unit."""
        std = None if self.std is None else factor * self.std
        return ModelCurve(self.angle, factor * self.error, std)


def rms_amplitude(parts: Iterable[Points]) -> float:
    """Amplitude of the sine that has the rms of some readings, arcsec: a unit is chosen by it."""
    errors = np.concatenate([np.zeros(0), *(part.y for part in parts)])
    return sine_of_rms(float(np.sqrt(np.mean(errors * errors)))) if errors.size else 0.0


def thinned_points(points: Points, most: int, number: int = 0) -> Points:
    """At most ``most`` points, evenly taken; equal runs begin at different points."""
    stride = -(-points.x.size // most)
    if stride <= 1:
        return points
    first = int(stride * (number * _GOLDEN % 1.0))
    return Points(points.label, points.x[first::stride], points.y[first::stride])


def run_label(run: CalibrationRun, number: int) -> str:
    """The run's label, or its number from 1."""
    return run.label or str(number + 1)


def reference_degrees(run: CalibrationRun, low: float = 0.0) -> Array:
    """Reference angles in degrees, on the turn that begins at ``low``."""
    return low + np.mod(run.reference * (360.0 / run.period) - low, 360.0)


def error_points(fit: FitResult) -> list[Points]:
    """Measured error of every run less that run's zero."""
    factor = ARCSEC_PER_TURN / fit.model.period
    low, _ = fitted_degrees(fit.model)
    found = []
    for number, run in enumerate(fit.runs):
        zero = fit.offsets[number]
        zero = run.zero if np.isnan(zero) else zero
        error = wrap(run.indicated - run.reference - zero, run.period)
        found.append(Points(run_label(run, number), reference_degrees(run, low), factor * error))
    return found


def model_curve(model: HarmonicModel, span: tuple[float, float] | None = None) -> ModelCurve:
    """The model without its constant, over ``span`` (deg), the turn or the fitted part."""
    highest = max(model.orders, default=1.0)
    low, high = fitted_degrees(model) if span is None else span
    count = int(np.clip(_PER_CYCLE * highest * (high - low) / 360.0, _FEWEST, _MOST_SAMPLES))
    angle = np.linspace(low, high, count)
    theta = angle * (model.period / 360.0)
    factor = ARCSEC_PER_TURN / model.period
    error = factor * (np.asarray(model.error(theta)) - model.constant)
    std = None if model.covariance is None else factor * model.band(theta)
    return ModelCurve(angle, error, std)


def strong_gear_order(
    orders: Sequence[float], amplitudes: Sequence[float] | Array, span: float
) -> float | None:
    """The strongest order whose periods fill a picture of ``span`` degrees; None without one."""
    pairs = list(zip(amplitudes, orders, strict=True))
    # Periods from which on a curve fills the picture: it is plotted as an envelope...
    fine = [(a, m) for a, m in pairs if m * span / 360.0 > 40.0]
    part = sum(a for a, _ in fine) / (sum(a for a, _ in pairs) or 1.0)
    # ... where such orders make this part of the amplitudes; smaller ones are ripple on a line.
    return float(max(fine)[1]) if part > 0.1 else None


def curve_envelope(curve: ModelCurve) -> tuple[Array, Array, Array]:
    """Least and greatest value of a curve, at places that each hold several periods.

    Returns
    -------
    angle, least, greatest : ndarray
    """
    edges = np.linspace(0, curve.angle.size, _PLACES + 1).astype(int)
    parts = [slice(a, b) for a, b in pairwise(edges) if b > a]
    # With its neighbours: a place of hardly a period would have ragged edges.
    wide = [slice(parts[max(i - 1, 0)].start, parts[min(i + 1, len(parts) - 1)].stop)
            for i in range(len(parts))]  # fmt: skip
    return (
        np.array([curve.angle[p].mean() for p in parts]),
        np.array([curve.error[p].min() for p in wide]),
        np.array([curve.error[p].max() for p in wide]),
    )


def fitted_degrees(model: HarmonicModel) -> tuple[float, float]:
    """The segment the model was fitted on, in degrees; a whole turn when it was all."""
    if model.partial_span is None:
        return 0.0, 360.0
    low, high = (360.0 / model.period * x for x in model.partial_span)
    if high - low >= 360.0:  # several turns of an error that does not repeat
        return 0.0, 360.0
    return _about_zero(low, high)


def travelled_degrees(runs: Sequence[CalibrationRun]) -> tuple[float, float]:
    """The segment of the turn that runs hold readings of, in degrees; a turn without a wide gap."""
    angle = np.sort(np.concatenate([reference_degrees(run) for run in runs]))
    gaps = np.diff(np.append(angle, angle[0] + 360.0))
    widest = int(np.argmax(gaps))
    # Degrees without a reading that make a travel partial, where no model states its span.
    if gaps[widest] < 90.0:
        return 0.0, 360.0
    low, high = float(angle[(widest + 1) % angle.size]), float(angle[widest])
    return _about_zero(low, high if high >= low else high + 360.0)


def _about_zero(low: float, high: float) -> tuple[float, float]:
    """An arc across zero reads better as -90 to 90 than as 270 to 450."""
    turns = 360.0 * np.floor((0.5 * (low + high) + 180.0) / 360.0) if high > 360.0 else 0.0
    return low - turns, high - turns


def held_out_points(
    model: HarmonicModel, runs: Sequence[CalibrationRun]
) -> list[tuple[Points, Points]]:
    """Error of runs that the model was not fitted to, before and after correction.

    Each run keeps its own zero (`trueangle.fitting.heldout.correct_held_out`).
    """
    low, _ = fitted_degrees(model)
    found = []
    for number, run in enumerate(runs):
        label = run_label(run, number)
        held = correct_held_out(model, run, label)
        x = reference_degrees(run, low)
        found.append((Points(label, x, held.before), Points(label, x, held.after)))
    return found


def residual_points(fit: FitResult, against: Signal = "angle") -> list[Points]:
    """Residuals of every run that has the signal ``against`` (see `SIGNALS`).

    Raises
    ------
    ArgumentError
        An unknown signal, or one that no run has.
    """
    check_choice("against", against, SIGNALS)
    factor = ARCSEC_PER_TURN / fit.model.period
    low, _ = fitted_degrees(fit.model)
    parts = np.split(fit.residuals, np.cumsum([len(run) for run in fit.runs])[:-1])
    found = []
    for number, (run, rest) in enumerate(zip(fit.runs, parts, strict=True)):
        x = reference_degrees(run, low) if against == "angle" else getattr(run, against)
        if x is None:
            continue
        scale = 360.0 / run.period if against == "speed" else 1.0
        found.append(Points(run_label(run, number), scale * np.asarray(x), factor * rest))
    if not found:
        raise ArgumentError(f"no run has {against}: it cannot be plotted against the residual")
    return found
