"""Which orders of the angle error are real: selection with evidence, aliases, the paper."""

from .result import OrderSelection
from .select import FALSE_ALARM, select_orders
from .table import OrderRow

__all__ = ["FALSE_ALARM", "OrderRow", "OrderSelection", "select_orders"]
