"""A selection of orders as plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...support.angles import arcsec
from ...support.plainresult import finite

if TYPE_CHECKING:
    from .table import OrderRow, OrderSelection

__all__ = ["plain_selection"]


def plain_selection(selection: OrderSelection) -> dict[str, Any]:
    """The selection with angles in arcsec; what is not a number becomes None."""
    scale = arcsec(1.0, selection.period)
    before, after = selection.holdout_rms
    return {
        "distinct_positions": len(selection.positions),
        "positions": selection.positions.describe(),
        "samples": selection.samples,
        "runs": selection.runs,
        "method": selection.method,
        "argument": selection.argument,
        "noise_arcsec": finite(scale * selection.noise.standard_deviation),
        "noise_source": selection.noise.source,
        "holdout": selection.holdout,
        "holdout_rms_before_arcsec": finite(scale * before),
        "holdout_rms_after_arcsec": finite(scale * after),
        "reason": selection.reason,
        "notes": list(selection.notes),
        "orders": [_row(row, scale) for row in selection.table],
    }


def _row(row: OrderRow, scale: float) -> dict[str, Any]:
    return {
        "order": row.order,
        "retained": row.retained,
        "verdict": row.verdict,
        "amplitude_arcsec": finite(scale * row.amplitude),
        "phase_deg": finite(row.phase_deg % 360.0),
        "std_arcsec": finite(scale * row.standard_error),
        "phase_std_deg": finite(row.phase_error_deg),
        "phase_spread_deg": finite(row.phase_spread_deg),
        "log10_false_alarm": finite(row.log10_false_alarm),
        "holdout_gain": finite(row.holdout_gain),
        "aliases": list(row.aliases),
        "explanations": [str(e) for e in row.explanations],
        "reason": row.reason,
    }
