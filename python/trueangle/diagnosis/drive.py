"""Torque of the drive, measured minus simulated, diagnosed for ripple, dry friction, damping.

::

    τ_measured - τ_simulated = F sgn θ̇ + d θ̇ - Σ_m T_m sin(mθ + φ_m) + n

It is diagnosed like an error of the angle: a line is a ripple, what follows the direction is dry
friction, and what follows the velocity is damping. Simulators have separate elements for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..effects.backlash import Backlash
from ..effects.direction_dependent_pattern import DirectionalPattern
from ..effects.latency import Latency
from ..effects.missing_order import MissingOrder
from ..effects.presliding_hysteresis import PreslidingHysteresis
from ..estimation.quantity import Quantity, quantity
from ..runs.run import CalibrationRun
from .finding import Finding
from .result import Diagnosis
from .torque import TorqueAccount, TorqueFinding, number_of_quantity

if TYPE_CHECKING:
    from ..runs.joining import MeasuredMinusSimulated

#: Degrees that the largest torque is put into: so small that an angle stays what it is.
_LARGEST = 0.01
#: Arcseconds in them.
_ARCSEC = 3600.0 * _LARGEST
#: Share of the largest torque below which a difference is rounding.
_ROUNDING = 1e-9

#: What the causes of an angle error are as a torque.
_EFFECTS: Final = {
    MissingOrder.kind: "torque_ripple",
    Backlash.kind: "dry_friction",
    Latency.kind: "damping",
    PreslidingHysteresis.kind: "presliding_friction",
    DirectionalPattern.kind: "friction_ripple",
}


def diagnose_drive(
    joined: MeasuredMinusSimulated,
    measured: Sequence[CalibrationRun],
    diagnosed: Callable[[list[CalibrationRun], MeasuredMinusSimulated], Diagnosis],
) -> TorqueAccount | None:
    """What the torque of the drive lacks; None where one of the two has no torque.

    Parameters
    ----------
    joined : MeasuredMinusSimulated
        States how the log was joined to the readings.
    measured : sequence of CalibrationRun
    diagnosed : callable
        Diagnoses runs whose error is the torque.
    """
    from ..runs.joining import minus_simulated  # loaded already: it joined the logs

    both = [*measured, *joined.logs]
    if not joined.logs or any(run.torque is None for run in both):
        return None
    largest = max(float(np.max(np.abs(np.asarray(run.torque)), initial=0.0)) for run in both)
    if not (largest > 0.0 and math.isfinite(largest)):
        return None
    runs, logs = (
        [_as_angle(run, k, largest) for k, run in enumerate(given)]
        for given in (measured, joined.logs)
    )
    by = joined.by[0] if len(set(joined.by)) == 1 else None
    log = minus_simulated(runs, logs, by=by)
    if all(float(np.max(np.abs(run.error))) < _ROUNDING * _LARGEST for run in log.runs):
        return None
    found = diagnosed(runs, log)
    one = largest / _ARCSEC
    return TorqueAccount(
        found.discrepancy.rms * one,
        found.noise * one,
        found.unexplained is not None and found.unexplained.found,
        tuple(_finding(finding, one) for finding in found.findings),
        found.complete,
    )


def _as_angle(run: CalibrationRun, number: int, largest: float) -> CalibrationRun:
    """A run whose error is its torque, and in which nothing else acts."""
    reference = run.unwrapped_reference * (360.0 / run.period)
    torque = np.asarray(run.torque, np.float64)
    speed = run.velocity
    return replace(
        run,
        reference=reference,
        indicated=reference + torque * (_LARGEST / largest),
        period=360.0,
        velocity=None if speed is None else np.asarray(speed) * (360.0 / run.period),
        torque=None,
        temperature=None,
        mount=None,
        signals={},
        columns={},
        label=str(number),
    )


def _finding(finding: Finding, one: float) -> TorqueFinding:
    """A finding in Nm; an arcsecond is ``one`` Nm."""
    effect = _EFFECTS.get(finding.cause, finding.cause)
    given = finding.parameters
    if effect == "damping":
        # The error is minus the delay times the velocity, arcsec per degree per second.
        scale = -one * 3600.0 * 180.0 / math.pi
        parameters = {"Nm_s_per_rad": _scaled(given["delay_s"], scale)}
    elif effect == "torque_ripple":
        # What acts on the joint is what its drive does not bring.
        phase = given["phase_deg"]
        parameters = {
            "order": given["output_order"],
            "torque_Nm": _scaled(given["amplitude_arcsec"], one),
            "phase_deg": quantity((number_of_quantity(phase) + 180.0) % 360.0, phase.std),
        }
    elif effect == "dry_friction":
        parameters = {"torque_Nm": _scaled(given["half_width_arcsec"], one)}
    else:
        parameters = {
            name.replace("_arcsec", "_Nm"): _scaled(q, one) if "_arcsec" in name else q
            for name, q in given.items()
        }
    return TorqueFinding(effect, parameters, finding.status, finding.reason)


def _scaled(given: Quantity, factor: float) -> Quantity:
    """A quantity times a factor."""

    def times(value: Any, by: float) -> Any:
        if isinstance(value, list):
            return [times(item, by) for item in value]
        return value * by if isinstance(value, float | int) else value

    return replace(given, value=times(given.value, factor), std=times(given.std, abs(factor)))
