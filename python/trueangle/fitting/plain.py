"""A fit as plain values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..support.angles import arcsec
from ..support.plainresult import finite

if TYPE_CHECKING:
    from .result import FitResult

__all__ = ["plain_fit"]


def plain_fit(found: FitResult) -> dict[str, Any]:
    """The fit with the same names whatever way it took; angles in arcsec."""
    period = found.model.period
    record = found.model.fit
    return {
        "readings": found.readings,
        "missing": found.missing,
        "runs": 0 if record is None else record.runs,
        "residual_arcsec": finite(arcsec(found.residual_std, period)),
        "condition_number": finite(found.condition_number),
        "method": found.method,
        "argument": found.model.argument,
        "ridge": found.ridge,
        "offset_spread_arcsec": arcsec(found.offset_spread, period),
        "covariance": found.uncertainty.kind,
        "intervals_hold": [
            "noise",
            *(["ridge"] if found.ridge > 0.0 else []),
            *(["prior"] if found.posterior is not None else []),
        ],
        "prior": None
        if found.posterior is None
        else {"units": found.posterior.units, "own_share": found.posterior.share},
        "wild": [list(place) for place in found.wild],
        "orders": [
            {
                "shaft": shaft,
                "order": order,
                "amplitude_arcsec": arcsec(float(found.amplitudes[n]), period),
                "phase_deg": math.degrees(float(found.phases[n])) % 360.0,
                **_spread(found, n),
            }
            for n, (shaft, order) in enumerate(
                (shaft.name, order) for shaft in found.model.shafts for order in shaft.orders
            )
        ],
        "evidence": _evidence(found),
        "notes": list(found.notes),
    }


def _evidence(found: FitResult) -> list[dict[str, Any]]:
    """The evidence for every order that was looked at; empty where the orders were given."""
    scale = arcsec(1.0, found.model.period)
    return [
        {
            "shaft": "output",
            "order": row.order,
            "retained": row.retained,
            "amplitude_arcsec": finite(scale * row.amplitude),
            "std_arcsec": finite(scale * row.standard_error),
            "phase_deg": finite(row.phase_deg % 360.0),
            "holdout_gain": finite(row.holdout_gain),
            "reason": row.reason,
        }
        for row in (() if found.selection is None else found.selection.table)
    ]


def _spread(found: FitResult, n: int) -> dict[str, Any]:
    """Standard error and 95 % interval of one amplitude; null where nothing tells them."""
    if found.model.covariance is None:
        return {"std_arcsec": None, "interval_arcsec": None}
    period = found.model.period
    return {
        "std_arcsec": finite(arcsec(float(found.amplitude_std[n]), period)),
        "interval_arcsec": [arcsec(v, period) for v in found.amplitude_interval()[n].tolist()],
    }
