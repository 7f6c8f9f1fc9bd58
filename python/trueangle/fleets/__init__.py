"""Many units of one design: what they share, how they differ, and what changes over months."""

from .file import load_fleet
from .fleet import fleet
from .result import Fleet
from .unitplan import UnitPlan, plan_unit

__all__ = ["Fleet", "UnitPlan", "fleet", "load_fleet", "plan_unit"]
