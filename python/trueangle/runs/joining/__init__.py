"""Two logs with two clocks joined to calibration runs; a simulator's log subtracted."""

from __future__ import annotations

from .join import join
from .result import Gap, Joined
from .simulated import MeasuredMinusSimulated, minus_simulated

__all__ = ["Gap", "Joined", "MeasuredMinusSimulated", "join", "minus_simulated"]
