"""What a report rests on: the fit, what it gains on held-out runs, its extension."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from ..errors import NoModelError, TrueAngleError
from ..fitting.heldout import HeldOut, hold_out
from ..joint.declared import DeclaredShaft
from ..joint.joint import Joint
from ..model.model import HarmonicModel
from ..runs.run import CalibrationRun
from .measured import error_size

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult
    from ..simulation import Simulation


def known_joint(
    simulation: Simulation | None,
    gear_ratio: float | None,
    fixed_member: str,
    shafts: Mapping[str, float] | None,
) -> Joint | None:
    """What is known of the shafts."""
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
    """What the fit gains on runs left out of it; or the reason why that is not known."""
    if fit is None:
        return None, "There is no model to hold against other runs."
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
