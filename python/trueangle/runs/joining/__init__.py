"""Two logs with two clocks made into calibration runs, and a simulator's log taken off runs."""

from __future__ import annotations

from .join import join
from .result import Gap, Joined
from .simulated import MeasuredMinusSimulated, minus_simulated

__all__ = ["Gap", "Joined", "MeasuredMinusSimulated", "join", "minus_simulated"]
