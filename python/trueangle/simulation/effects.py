"""Effects that a simulation can have: those of `trueangle.effects`."""

from ..effects import EFFECTS, Effect
from ..joint.pattern import JointPattern

__all__ = ["EFFECTS", "Effect", "JointPattern"]
