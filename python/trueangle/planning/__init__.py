"""Where to measure so that the wanted orders can be separated."""

from .arc import plan_arc
from .limits import Limits, load_limits
from .nextruns import NextRuns
from .plan import (
    HIGHEST_LOW_ORDER,
    plan_encoder,
    plan_mounts,
    plan_tilts,
    readings_needed,
    wanted_orders,
)
from .result import ArcPlan, CalibrationPlan, SelfPlan
from .selfplan import plan_self

__all__ = [
    "HIGHEST_LOW_ORDER",
    "ArcPlan",
    "CalibrationPlan",
    "Limits",
    "NextRuns",
    "SelfPlan",
    "load_limits",
    "plan_arc",
    "plan_encoder",
    "plan_mounts",
    "plan_self",
    "plan_tilts",
    "readings_needed",
    "wanted_orders",
]
