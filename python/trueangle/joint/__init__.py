"""The machine: shafts, gear lines, the pattern, and signals at every reading."""

from __future__ import annotations

from typing import Final

FIXED_MEMBERS: Final = ("circular_spline", "flexspline", "none")
