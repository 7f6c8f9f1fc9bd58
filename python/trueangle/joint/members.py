"""Which member of a strain wave gear is fixed."""

from __future__ import annotations

from typing import Final

FIXED_MEMBERS: Final = ("circular_spline", "flexspline", "none")
