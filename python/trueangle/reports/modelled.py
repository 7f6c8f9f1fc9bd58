"""The correction model as plain values, the fit it rests on, and what it gains and leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError, TrueAngleError
from ..fitting.heldout import HeldOut, hold_out
from ..fitting.orders.table import IN_MODEL
from ..joint.joint import DeclaredShaft, Joint
from ..model.model import HarmonicModel
from ..plots.curves import fitted_degrees
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, circular_mean, wrap
from ..support.plainresult import finite_or_none
from .figures import LineNames
from .measured import error_size

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult
    from ..simulation import Simulation


def model_content(fit: FitResult, name: LineNames) -> dict[str, Any]:
    """Coefficients with standard errors, and the quality of the fit, in arcsec and deg."""
    model = fit.model
    factor = ARCSEC_PER_TURN / model.period
    coefficients = []
    known = model.covariance is not None
    sigma = np.sqrt(np.diag(fit.covariance)) * factor if known else None
    rows = [(s, i) for s in model.shafts for i in range(len(s.orders))]
    for n, (shaft, i) in enumerate(rows):
        coefficients.append(
            {
                "line": name(shaft.orders[i] * shaft.cycles_per_turn),
                "shaft": shaft.name,
                "order": shaft.orders[i],
                "output_order": shaft.orders[i] * shaft.cycles_per_turn,
                "cosine_arcsec": factor * shaft.cosine[i],
                "cosine_std_arcsec": None if sigma is None else float(sigma[1 + 2 * n]),
                "sine_arcsec": factor * shaft.sine[i],
                "sine_std_arcsec": None if sigma is None else float(sigma[2 + 2 * n]),
                "amplitude_arcsec": factor * float(fit.amplitudes[n]),
                "amplitude_std_arcsec": factor * float(fit.amplitude_std[n]) if known else None,
                "phase_deg": math.degrees(fit.phases[n]) % 360.0,
                "phase_std_deg": _degrees(fit.phase_std[n]) if known else None,
            }
        )
    return {
        "argument": model.argument,
        "indicated_sign": model.indicated_sign,
        "span_deg": list(fitted_degrees(model)),
        "constant_deg": model.constant * 360.0 / model.period,
        "coefficients": coefficients,
        "residual_std_arcsec": finite_or_none(factor * fit.residual_std),
        "degrees_of_freedom": float(fit.degrees_of_freedom),
        "condition_number": finite_or_none(fit.condition_number),
        "offset_spread_arcsec": factor * fit.offset_spread,
        "wild_readings": len(fit.wild),
        "ridge": fit.ridge,
        "correlations": _correlations(fit, name) if known else [],
        "notes": list(fit.notes),
    }


def _correlations(fit: FitResult, name: LineNames) -> list[dict[str, Any]]:
    """The strongest correlations between two coefficients."""
    names = [
        f"{part} of {name(order * shaft.cycles_per_turn)}"
        for shaft in fit.model.shafts
        for order in shaft.orders
        for part in ("A", "B")
    ]
    std = np.sqrt(np.diag(fit.covariance))[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        matrix = fit.covariance[1:, 1:] / np.outer(std, std)
    upper = np.triu(np.nan_to_num(np.abs(matrix)), k=1)
    strongest = np.argsort(upper, axis=None)[::-1][:5]
    pairs = zip(*np.unravel_index(strongest, upper.shape), strict=True)
    return [
        {"first": names[i], "second": names[j], "correlation": float(matrix[i, j])}
        for i, j in pairs
        # Smaller correlations of coefficients are not worth a note.
        if upper[i, j] >= 0.3
    ]


def order_content(selection: OrderSelection, name: LineNames) -> dict[str, Any]:
    """Every candidate order and the evidence for or against it."""
    factor = ARCSEC_PER_TURN / selection.period
    before, after = selection.holdout_rms
    return {
        "orders": [float(m) for m in selection.orders],
        "reason": selection.reason,
        "holdout": selection.holdout,
        "holdout_rms_before_arcsec": finite_or_none(factor * before),
        "holdout_rms_after_arcsec": finite_or_none(factor * after),
        "noise_arcsec": finite_or_none(factor * selection.noise.standard_deviation),
        "noise_source": selection.noise.source,
        "gear_ratio": selection.gear_ratio,
        "notes": list(selection.notes),
        "table": [
            {
                "line": name(float(row.order)),
                "order": float(row.order),
                "retained": row.verdict in IN_MODEL,
                "verdict": row.verdict,
                "amplitude_arcsec": finite_or_none(factor * row.amplitude),
                "std_arcsec": finite_or_none(factor * row.standard_error),
                "phase_deg": finite_or_none(row.phase_deg % 360.0),
                "phase_std_deg": finite_or_none(row.phase_error_deg),
                "phase_spread_deg": finite_or_none(row.phase_spread_deg),
                "holdout_gain_percent": finite_or_none(100.0 * row.holdout_gain),
                "aliases": [float(m) for m in row.aliases],
                "explanations": [str(e) for e in row.explanations],
                "reason": row.reason,
            }
            for row in selection.table
        ],
    }


def _degrees(radians: float) -> float:
    return min(math.degrees(radians), 180.0) if math.isfinite(radians) else 180.0


def given_model(
    model: HarmonicModel | str | PathLike[str], runs: Sequence[CalibrationRun]
) -> dict[str, Any]:
    """Whether it was calibrated without a reference, what it is blind to, error on the runs.

    Every run keeps a separate zero. Models that need signals are described only.
    """
    if not isinstance(model, HarmonicModel):
        from ..model.file import load_model

        model = load_model(model)
    record = model.fit
    content: dict[str, Any] = {
        "method": None if record is None else record.method,
        "calibrated_without_reference": bool(record and record.calibrated_without_reference),
        "blind": [] if record is None else list(record.blind),
        "note": "" if record is None else record.note,
        "before_arcsec": None,
        "after_arcsec": None,
    }
    if model.signals or model.terms:
        return content
    before: list[NDArray[np.float64]] = []
    after: list[NDArray[np.float64]] = []
    for run in runs:
        turn = model.period / run.period
        for angle, found in (
            (run.indicated * turn, before),
            (np.asarray(model.correct(run.indicated * turn)), after),
        ):
            gap = angle - run.reference * turn
            found.append(wrap(gap - circular_mean(gap, model.period), model.period))
    factor = ARCSEC_PER_TURN / model.period
    for name, parts in (("before_arcsec", before), ("after_arcsec", after)):
        content[name] = float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) * factor
    return content


def known_joint(
    simulation: Simulation | None,
    gear_ratio: float | None,
    fixed_member: str,
    shafts: Mapping[str, float] | None,
) -> Joint | None:
    """What is known about the shafts."""
    if simulation is not None:
        return simulation.joint
    if gear_ratio is None and not shafts:
        return None
    declared = tuple(DeclaredShaft(name, cycles) for name, cycles in (shafts or {}).items())
    if gear_ratio is None:
        return Joint(declared=declared)
    return Joint(gear_ratio, fixed_member, "motor", declared=declared)


def known_gear(joint: Joint | None) -> dict[str, Any]:
    """The joint as `trueangle.fit` takes it."""
    if joint is None:
        return {}
    gear: dict[str, Any] = {"shafts": {s.name: s.cycles for s in joint.declared} or None}
    if "motor" in joint.shafts:
        gear |= {"gear_ratio": joint.gear_ratio, "fixed_member": joint.fixed_member}
    return gear


def fit_or_reason(
    runs: list[CalibrationRun], orders: Any, joint: Joint | None
) -> tuple[FitResult | None, OrderSelection | None, str]:
    """The fit; or the selection and the reason why there is none."""
    from ..fitting.fit import fit as fit_runs

    try:
        fit = fit_runs(runs, orders, **known_gear(joint))
    except NoModelError as reason:
        from ..fitting.orders.select import select_orders

        selection = select_orders(runs, **known_gear(joint))
        return None, selection, str(reason)
    return fit, fit.selection, ""


def gain_or_reason(fit: FitResult | None) -> tuple[HeldOut | None, str]:
    """The gain of the fit on held-out runs, or the reason why it is not known."""
    if fit is None:
        return None, "There is no model to compare with other runs."
    try:
        return hold_out(fit), ""
    except TrueAngleError as reason:
        return None, f"{str(reason)[0].upper()}{str(reason)[1:]}."


def extended_correction(
    fit: FitResult | None,
    diagnosis: Diagnosis,
    runs: list[CalibrationRun],
    sim: Simulation,
) -> dict[str, Any] | None:
    """The correction with the causes found as its terms; None where there are none."""
    if fit is None or not diagnosis.findings:
        return None
    from ..diagnosis.heldout import hold_out_extended

    try:
        model = diagnosis.correction(fit.model, runs)
        return _extended_model(model, hold_out_extended(fit, sim)) if model.terms else None
    except TrueAngleError:
        return None


def gain_content(held: HeldOut) -> dict[str, Any]:
    """Error of held-out runs before and after correction, in all and run by run."""
    interval = held.reduction_interval
    return {
        "before": error_size([run.before for run in held.runs]),
        "after": error_size([run.after for run in held.runs]),
        "reduction_percent": 100.0 * held.reduction,
        "reduction_low_percent": None if interval is None else 100.0 * interval[0],
        "reduction_high_percent": None if interval is None else 100.0 * interval[1],
        "runs": [
            {
                "label": run.label,
                "corrected": run.model is not None,
                "before": error_size([run.before]),
                "after": error_size([run.after]),
            }
            for run in held.runs
        ],
        "left_in": [{"label": label, "because": why} for label, why in held.left_in],
    }


def _extended_model(model: HarmonicModel, held: HeldOut) -> dict[str, Any]:
    """Terms of the extended correction, and what they gain on held-out runs."""
    terms = []
    for term in model.terms:
        values = {f.name: getattr(term, f.name) for f in fields(term)}
        numbers = {name: v for name, v in values.items() if isinstance(v, int | float)}
        terms.append(
            {
                "kind": term.kind,
                "parameters": [{"name": k, "value": float(v)} for k, v in numbers.items()],
            }
        )
    return {"terms": terms, "orders": [float(m) for m in model.orders], "gain": gain_content(held)}
