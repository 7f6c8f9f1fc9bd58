"""The shafts of a joint, under the name they had before: see `trueangle.joint.shafts`."""

from .joint.shafts import FIXED_MEMBERS, Shaft, ShaftOrders, resolve_orders, shaft_cycles

__all__ = ["FIXED_MEMBERS", "Shaft", "ShaftOrders", "resolve_orders", "shaft_cycles"]
