"""Two logs with two clocks made into calibration runs."""

from __future__ import annotations

from .join import join
from .result import Gap, Joined

__all__ = ["Gap", "Joined", "join"]
