"""Plans as plain values; an infinite noise factor becomes None."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..support.plainresult import finite

if TYPE_CHECKING:
    from .plan import CalibrationPlan
    from .selfplan import SelfPlan

__all__ = ["plain_plan", "plain_self_plan"]


def plain_plan(plan: CalibrationPlan) -> dict[str, Any]:
    """A plan of positions and mounts."""
    return {
        "kind": plan.kind,
        "positions": plan.positions,
        "mount_offsets_deg": list(plan.mount_offsets_deg),
        "facet_shifts": list(plan.facet_shifts),
        "facet_noise_factor": finite(plan.facet_noise_factor),
        "worst_noise_factor": finite(plan.worst_noise_factor),
        "noise_factors": _plain(plan.noise_factors),
        "invisible_orders": list(plan.invisible_orders),
        "tolerance_deg": plan.tolerance_deg,
        "readings": plan.readings,
        "notes": list(plan.notes),
    }


def plain_self_plan(plan: SelfPlan) -> dict[str, Any]:
    """A plan of a calibration without a reference."""
    return {
        "method": plan.method,
        "orders": list(plan.orders),
        "noise_factors": _plain(plan.noise_factors),
        "worst_noise_factor": _plain(plan.worst_noise_factor),
        "blind_orders": list(plan.blind_orders),
        "angles_deg": list(plan.angles_deg),
        "given": _plain(plan.given),
        "speed_ratio": plan.speed_ratio,
        "speed_ratio_factors": _plain(plan.speed_ratio_factors),
        "turns": plan.turns,
        "readings": plan.readings,
        "seconds": plan.seconds,
        "knots_per_turn": plan.knots_per_turn,
        "notes": list(plan.notes),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            (f"{k:g}" if isinstance(k, (int, float)) else k): _plain(v) for k, v in value.items()
        }
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value if not isinstance(value, float) or math.isfinite(value) else None
