"""Effects that a simulation can have: those of `trueangle.effects`."""

from ..effects import EFFECTS, Effect
from ..joint.pattern import JointPattern as Surroundings  # its name in earlier releases

__all__ = ["EFFECTS", "Effect", "Surroundings"]
