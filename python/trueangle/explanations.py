"""Known lines of gears, under the name they had before: see `trueangle.joint.gear`."""

from .joint.gear import COMMON_RATIOS, Explanation, explain_order, gear_orders

__all__ = ["COMMON_RATIOS", "Explanation", "explain_order", "gear_orders"]
