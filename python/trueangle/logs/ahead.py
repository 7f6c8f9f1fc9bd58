"""Work done by further threads: moved to `trueangle.formats.ahead`."""

from ..formats.ahead import ahead, side_by_side

__all__ = ["ahead", "side_by_side"]
