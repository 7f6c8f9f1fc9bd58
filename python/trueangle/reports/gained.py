"""The gain on held-out runs as plain values."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ..fitting.heldout import HeldOut
from ..model.model import HarmonicModel
from .measured import error_size

__all__ = ["extended_model", "gain_content"]


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


def extended_model(model: HarmonicModel, held: HeldOut) -> dict[str, Any]:
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
