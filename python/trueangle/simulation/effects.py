"""Effects that a simulation can have: those of `trueangle.effects`."""

from ..effects import EFFECTS, Effect
from ..joint.pattern import Surroundings

__all__ = ["EFFECTS", "Effect", "Surroundings"]
